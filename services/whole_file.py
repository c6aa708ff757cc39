"""Files that are written whole: whoever reads meanwhile, or after a power cut, finds the old one or the new one."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

PRIVATE = 0o600
# Of its folder's mode, what a new file of root's has, and a new folder: nothing is for everybody to write.
FILE, FOLDER = 0o664, 0o2775


@contextmanager
def whole_file(file: Path, *, mode: int | None = None, like: Path | None = None) -> Iterator[BinaryIO]:
    """An output that takes the file's place at the end; after an exception the file is as it was. OSError.

    Who may read it: as `mode` says, from the first byte on; else as it was, or as `like` is. A link stays a link.
    What root writes belongs to whom it belonged, or to whom the folder does, and what is new is for those who write in
    that folder: a service reads what a restore wrote, and writes it.
    """
    real, model = file.resolve(), like or file
    make_folder(real.parent)
    owner = (real if real.exists() else real.parent).stat()
    if mode is None:
        mode = model.stat().st_mode & 0o777 if model.exists() else _mode(owner)
    beside = real.with_name(f".{real.name}.{os.getpid()}-{threading.get_ident()}")
    try:
        with open(os.open(beside, os.O_RDWR | os.O_CREAT | os.O_EXCL, mode or 0o666), "w+b") as output:
            if mode is not None:
                os.fchmod(output.fileno(), mode)
            if os.geteuid() == 0:
                os.fchown(output.fileno(), owner.st_uid, owner.st_gid)
            yield output
            output.flush()
            os.fsync(output.fileno())
        beside.replace(real)
    finally:
        beside.unlink(missing_ok=True)


def _mode(folder: os.stat_result) -> int | None:
    """Of a new file in a folder: root's, as said above; all others' is as they want it by their umask."""
    return folder.st_mode & FILE if os.geteuid() == 0 else None


def make_folder(folder: Path) -> None:
    """With the folders that it is in; root's are for whom the first one is that was there. OSError."""
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    if missing and os.geteuid() == 0:
        owner = missing[-1].parent.stat()
        for one in missing:
            os.chown(one, owner.st_uid, owner.st_gid)
            one.chmod(owner.st_mode & FOLDER)


def make_empty(file: Path) -> None:
    """A file that others fill, where there is none. Root's is its folder's: who may write there writes it. OSError."""
    with suppress(FileExistsError):
        made = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        try:
            folder = file.parent.stat()
            if (mode := _mode(folder)) is not None:
                os.fchmod(made, mode)
                os.fchown(made, folder.st_uid, folder.st_gid)
        finally:
            os.close(made)


def write_whole(file: Path, content: str | bytes, *, mode: int | None = None, like: Path | None = None) -> None:
    """The same for what is at hand; text as UTF-8."""
    with whole_file(file, mode=mode, like=like) as output:
        output.write(content.encode() if isinstance(content, str) else content)


def write_private(file: Path, content: str | bytes) -> None:
    """The same for secrets: nobody but the owner reads it."""
    write_whole(file, content, mode=PRIVATE)

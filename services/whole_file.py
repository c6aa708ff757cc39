"""Files that are written whole: whoever reads meanwhile, or after a power cut, finds the old one or the new one."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

PRIVATE = 0o600
AS_FOLDER = 0o664  # of its folder's mode, what a new file of root's has: nothing is for everybody to write


@contextmanager
def whole_file(file: Path, *, mode: int | None = None, like: Path | None = None) -> Iterator[BinaryIO]:
    """An output that takes the file's place at the end; after an exception the file is as it was. OSError.

    Who may read it: as `mode` says, from the first byte on; else as it was, or as `like` is. A link stays a link.
    What root writes belongs to whom it belonged, or to whom the folder does: a service reads what a restore wrote.
    """
    real, model = file.resolve(), like or file
    make_folder(real.parent)
    owner = (real if real.exists() else real.parent).stat()
    if mode is None and model.exists():
        mode = model.stat().st_mode & 0o777
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


def make_folder(folder: Path) -> None:
    """With the folders that it is in; they belong to whom the first one does that was there. OSError."""
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    if missing and os.geteuid() == 0:
        owner = missing[-1].parent.stat()
        for one in missing:
            os.chown(one, owner.st_uid, owner.st_gid)


def make_empty(file: Path) -> None:
    """A file that others fill, where there is none. Root's is its folder's: who may write there writes it. OSError."""
    with suppress(FileExistsError):
        made = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        try:
            if os.geteuid() == 0:
                folder = file.parent.stat()
                os.fchown(made, folder.st_uid, folder.st_gid)
                os.fchmod(made, folder.st_mode & AS_FOLDER)
        finally:
            os.close(made)


def write_whole(file: Path, content: str | bytes, *, mode: int | None = None, like: Path | None = None) -> None:
    """The same for what is at hand; text as UTF-8."""
    with whole_file(file, mode=mode, like=like) as output:
        output.write(content.encode() if isinstance(content, str) else content)


def write_private(file: Path, content: str | bytes) -> None:
    """The same for secrets: nobody but the owner reads it."""
    write_whole(file, content, mode=PRIVATE)

"""Files that are written whole: whoever reads meanwhile, or after a power cut, finds the old one or the new one."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

PRIVATE = 0o600


@contextmanager
def whole_file(file: Path, *, mode: int | None = None, like: Path | None = None) -> Iterator[BinaryIO]:
    """An output that takes the file's place at the end; after an exception the file is as it was. OSError.

    Who may read it: as `mode` says, from the first byte on; else as it was, or as `like` is. A link stays a link.
    What root writes belongs to whom it belonged, or to whom the folder does: a service reads what a restore wrote.
    """
    real, model = file.resolve(), like or file
    _make(real.parent)
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


def _make(folder: Path) -> None:
    """With the folders that it is in; they belong to whom the first one does that was there."""
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    if missing and os.geteuid() == 0:
        owner = missing[-1].parent.stat()
        for one in missing:
            os.chown(one, owner.st_uid, owner.st_gid)


def write_whole(file: Path, content: str | bytes, *, mode: int | None = None, like: Path | None = None) -> None:
    """The same for what is at hand; text as UTF-8."""
    with whole_file(file, mode=mode, like=like) as output:
        output.write(content.encode() if isinstance(content, str) else content)


def write_private(file: Path, content: str | bytes) -> None:
    """The same for secrets: nobody but the owner reads it."""
    write_whole(file, content, mode=PRIVATE)

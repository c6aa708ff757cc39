"""The file of SQLite among others: who shares its folder writes it, whoever of them made it.

In an installation root makes it (`apartment db init`, a restore) or the writer, and the keeper of `history` deletes in
it, each under a user of its own. SQLite makes what is beside the file, its log, for the same users as the file.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from services.errors import ConfigError
from services.whole_file import make_empty, make_folder

SHARED = stat.S_ISGID | stat.S_IWGRP  # of a folder: what is in it is the group's
BY_GROUP = stat.S_IRGRP | stat.S_IWGRP


def make_ready(file: Path) -> None:
    """Makes file and folder where they are missing; ConfigError when it cannot be, or is not ours to write.

    SQLite itself opens what it may only read, and says so at the first row.
    """
    try:
        make_folder(file.parent)
    except OSError as error:
        raise ConfigError([f"the database's folder cannot be made: {error}"]) from error
    try:
        make_empty(file)
    except OSError as error:
        raise ConfigError([f"the database cannot be made: {error}"]) from error
    if not os.access(file, os.W_OK, effective_ids=True):
        raise ConfigError([f"the database cannot be used: {file} may not be written: {_mend(file)}"])


def look_at_rights(file: Path) -> tuple[bool, str]:
    """Whether all who share its folder can write it, and who can; a folder that is nobody's else shares nothing."""
    own, folder = file.stat(), file.parent.stat()
    told = f"{file}: {stat.filemode(own.st_mode)}"
    if folder.st_mode & SHARED != SHARED or (own.st_gid == folder.st_gid and own.st_mode & BY_GROUP == BY_GROUP):
        return True, told
    return False, f"{told}, and not all who share its folder can write it: {_mend(file)}"


def _mend(file: Path) -> str:
    return f"sudo chown --reference={file.parent} {file}*; sudo chmod 660 {file}*"

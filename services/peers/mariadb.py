"""A private MariaDB: its own data, free port and socket, two databases, and an account each for writing and reading."""

from __future__ import annotations

import getpass
import json
import os
import secrets
import socket as sockets
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from services.peers import free_port, program, running
from services.whole_file import write_private

PACKAGE = "mariadb-server"
SOCKET_LIMIT = 100  # a unix socket's path may have 107 bytes
SMALL = ("--innodb-log-file-size=96M", "--innodb-buffer-pool-size=128M", "--performance-schema=OFF", "--skip-log-bin")
SAFE = (
    "--innodb-flush-log-at-trx-commit=1",  # a commit is on the disk before it is answered
    "--innodb-doublewrite=ON",
    "--sql-mode=STRICT_TRANS_TABLES,ERROR_FOR_DIVISION_BY_ZERO,NO_ENGINE_SUBSTITUTION",
    "--character-set-server=utf8mb4",
    "--collation-server=utf8mb4_unicode_ci",
)
SETUP = """\
CREATE DATABASE IF NOT EXISTS `{database}` CHARACTER SET utf8mb4;
CREATE DATABASE IF NOT EXISTS `{view_database}` CHARACTER SET utf8mb4;
CREATE OR REPLACE USER `{user}`@`%` IDENTIFIED BY '{password}';
CREATE OR REPLACE USER `{reader}`@`%` IDENTIFIED BY '{reader_password}';
GRANT SELECT, INSERT, UPDATE, DELETE, CREATE, ALTER, DROP, INDEX ON `{database}`.* TO `{user}`@`%`;
GRANT SELECT, CREATE VIEW, SHOW VIEW, DROP ON `{view_database}`.* TO `{user}`@`%`;
GRANT SELECT ON `{view_database}`.* TO `{reader}`@`%`;
"""


@dataclass(frozen=True)
class Server:
    """A running server. `user` may write both databases, `reader` may read the views and nothing else.

    `admin` may do everything, by the socket and without a password, for the user who started the server only.
    """

    port: int
    socket: Path
    password: str = field(repr=False)
    reader_password: str = field(repr=False)
    host: str = "127.0.0.1"
    user: str = "apartment"
    reader: str = "reader"
    database: str = "bus"
    view_database: str = "OpenHAB"
    admin: str = field(default_factory=getpass.getuser)
    pid: int = 0

    @property
    def url(self) -> str:
        """The address for `services.storage`, by the socket."""
        return f"mysql://{self.user}@localhost/{self.database}?socket={self.socket}"

    @property
    def tcp_url(self) -> str:
        """The same by TCP."""
        return f"mysql://{self.user}@{self.host}:{self.port}/{self.database}"


@contextmanager
def private(folder: Path, port: int = 0) -> Iterator[Server]:
    """Runs a server on `folder` until the end of the block; Missing where MariaDB is not installed.

    Started again on the same folder it has its data, accounts and port back, also after a kill -9. Passwords are
    made here; they stand in a file of `folder` that only this user can read, and on no command line.
    """
    install, command = program("mariadb-install-db", PACKAGE), program("mariadbd", PACKAGE)
    folder.mkdir(parents=True, exist_ok=True)
    data = folder.resolve() / "data"
    if not (folder / "installed").exists():
        _install(install, data)
        (folder / "installed").touch()
    known = _known(folder / "accounts.json", port)
    setup = folder.resolve() / "setup.sql"
    write_private(setup, _setup(known))
    with _socket(folder) as socket:
        arguments = [command, *_options(data), f"--port={known['port']}", f"--socket={socket}", f"--init-file={setup}"]
        with running(arguments, folder / "mariadb.log", lambda: _greets(int(known["port"]))) as process:
            setup.unlink()
            yield _server(known, socket, process.pid)


def _greets(port: int) -> bool:
    """Whether the server speaks: it accepts connections well before it has run the setup and listens to signals."""
    try:
        with sockets.create_connection(("127.0.0.1", port), timeout=0.5) as probe:
            return bool(probe.recv(1))
    except OSError:
        return False


def _server(known: dict[str, str], socket: Path, pid: int) -> Server:
    return Server(int(known["port"]), socket, known["password"], known["reader_password"], pid=pid)


def _setup(known: dict[str, str]) -> str:
    server = _server(known, Path(), 0)
    return SETUP.format(**vars(server))


def _options(data: Path) -> list[str]:
    user = ["--user=root"] if os.geteuid() == 0 else []
    return [
        "--no-defaults", f"--datadir={data}", *user, *SMALL, *SAFE, "--bind-address=127.0.0.1", "--skip-name-resolve",
        f"--pid-file={data / 'mariadbd.pid'}", f"--tmpdir={data.parent}", "--max-connections=50",
    ]  # fmt: skip


def _install(command: str, data: Path) -> None:
    """The system tables; the account without a password is this user's, by the socket."""
    user = ["--user=root"] if os.geteuid() == 0 else []
    done = subprocess.run(
        [
            command, "--no-defaults", f"--datadir={data}", *user, *SMALL, "--skip-test-db", "--skip-name-resolve",
            f"--tmpdir={data.parent}",  # a server that starts deletes what others have in a shared one
            "--auth-root-authentication-method=socket", f"--auth-root-socket-user={getpass.getuser()}",
        ],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{command} ended with {done.returncode}:\n{done.stdout[-1000:]}{done.stderr[-1000:]}")


def _known(file: Path, port: int) -> dict[str, str]:
    """Port and passwords of this folder, made at its first start."""
    if file.exists():
        known: dict[str, str] = json.loads(file.read_text(encoding="utf-8"))
        return known
    made = {
        "port": str(port or free_port()),
        "password": secrets.token_urlsafe(24),
        "reader_password": secrets.token_urlsafe(24),
    }
    write_private(file, json.dumps(made))
    return made


@contextmanager
def _socket(folder: Path) -> Iterator[Path]:
    """Where the socket goes: the folder, or a short one where that path would be too long for a socket."""
    path = folder.resolve() / "mariadb.sock"
    if len(os.fsencode(path)) <= SOCKET_LIMIT:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="mariadb-") as short:
        yield Path(short) / "mariadb.sock"

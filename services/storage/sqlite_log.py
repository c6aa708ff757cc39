"""SQLite's write-ahead log, emptied into the file beside the writer, who would otherwise wait for it.

SQLite itself does it in the commit after which the log has 1,000 pages: with years of rows in the file that is a
thousand places to write and two waits for the disk, in the middle of a turn. Here a thread copies what is there while
the writer goes on. The log begins anew when nobody has written during a copy, which the second, short one mostly
meets; a log that has become long all the same is ended while the writer waits (https://sqlite.org/wal.html, 3.3).
"""

from __future__ import annotations

import logging
import sqlite3
import threading
from contextlib import closing
from pathlib import Path

ROWS = 2000  # after which the log is emptied; a row changes a page or less
LONGEST_HOLD_S = 0.02  # for the writer, while somebody still reads from the log: then it is emptied the next time
COPIES = 3
LONG = 16_000  # pages: 64 MB

log = logging.getLogger(__name__)


class Log:
    """Of the database in `file`. Its thread begins with the first rows that make it worth while."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._rows = 0
        self._due = threading.Event()
        self._ended = False
        self._thread = threading.Thread(target=self._empty, name="log of the database", daemon=True)

    def grown(self, rows: int) -> None:
        """So many rows were committed."""
        self._rows += rows
        if self._rows >= ROWS:
            self._rows = 0
            if not self._thread.is_alive():
                self._thread.start()
            self._due.set()

    def close(self) -> None:
        """Ends the thread; SQLite empties the log itself when the last connection closes."""
        self._ended = True
        self._due.set()
        if self._thread.is_alive():
            self._thread.join()

    def _empty(self) -> None:
        with closing(sqlite3.connect(self._file, timeout=LONGEST_HOLD_S, isolation_level=None)) as connection:
            while self._due.wait() and not self._ended:
                self._due.clear()
                try:
                    for _ in range(COPIES):
                        _busy, pages, _copied = connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
                    if pages > LONG:
                        connection.execute("PRAGMA wal_checkpoint(RESTART)").fetchone()
                except sqlite3.Error as error:
                    log.warning("the log of the database stays as long as it is: %s", error)

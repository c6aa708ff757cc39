"""The connection to the database, made again after a loss, with a growing pause between attempts."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable

from services.errors import ConfigError, Unavailable
from services.storage import Storage

log = logging.getLogger(__name__)

RETRY_S = (0.1, 5.0)  # the pause after the first failure; it doubles up to the longest


class Connection:
    """Gives the open storage, or raises Unavailable at once between attempts. Never sleeps; a loss is told once.

    `due` is when the next attempt is wanted; None while connected.
    """

    def __init__(self, opener: Callable[[], Storage], counters: Counter[str]) -> None:
        self._opener = opener
        self._counters = counters
        self._storage: Storage | None = None
        self._pause = RETRY_S[0]
        self._reason = ""  # why there is no connection, or has been none until nothing failed any more
        self.due: float | None = None

    def first(self) -> None:
        """The attempt at the start: ConfigError comes out of it, a database that is away is waited for."""
        try:
            self._storage = self._opener()
        except Unavailable as error:
            self._tell(error)

    @property
    def opened(self) -> Storage | None:
        """The storage as far as it is open now."""
        return self._storage

    def storage(self, now: float) -> Storage:
        """The open storage; one attempt to open it when that is due."""
        if self._storage is None:
            if self.due is not None and now < self.due:
                raise Unavailable(self._reason)
            self._storage = self._open(now)
            self._counters["reconnects"] += 1
            self.due = None
        return self._storage

    def _open(self, now: float) -> Storage:
        try:
            return self._opener()
        except (ConfigError, Unavailable) as error:
            away = Unavailable(str(error))
            self.lost(away, now)
            raise away from error

    def lost(self, error: Unavailable, now: float) -> None:
        """A call failed: this storage is not used any more."""
        self.close()
        self._tell(error)
        self.due = now + self._pause
        self._pause = min(2 * self._pause, RETRY_S[1])

    def worked(self) -> None:
        """A turn is written: what was wrong is over."""
        if self._reason:
            log.info("the database is back")
            self._reason = ""
        self._pause = RETRY_S[0]

    def _tell(self, error: Unavailable) -> None:
        if not self._reason:
            log.warning("waiting for the database: %s", error)
        self._reason = str(error)

    def close(self) -> None:
        """Ends the connection, if there is one."""
        if self._storage is not None:
            self._storage.close()
            self._storage = None

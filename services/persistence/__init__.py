"""Writes what happens to the database: states of items, sightings, scans, orders, changes of diagnostics.

Listens to every topic that `topics/` marks as stored. Says `home/<item>/state`, retained, for items whose last
state it restores at the start because the broker has none. Reading is the history service's.
"""

from services.persistence.service import Config, check, start

__all__ = ["Config", "check", "start"]

"""Answers what was: last values, samples, means per bucket, changes, how long in which state.

Listens to `history/get`, says `history/reply/<id>`. A service of its own, so that reading never delays writing, and
not durable, so that no question of yesterday is answered. It also keeps the means and clears old rows (`keeping.py`).
"""

from services.history.service import Config, start

__all__ = ["Config", "start"]

"""Loaded by every Python under libfaketime, which is told to leave the monotonic clock alone.

Its version 0.9.10 then breaks clock_nanosleep with an absolute time, by which Python sleeps: EINVAL. So a sleep is a
wait for nothing here.
"""

from __future__ import annotations

import select
import time


def sleep(seconds: float) -> None:
    """As time.sleep."""
    select.select([], [], [], seconds)


time.sleep = sleep

"""Memory on a machine that has little: what was freed is not kept, and what stays is not walked again and again.

The first is glibc's; a C library without these functions needs none of them (mallopt(3), malloc_trim(3)).
"""

from __future__ import annotations

import ctypes
import gc
import os

ARENAS = 2  # many threads that wait would take many times what one needs
_M_ARENA_MAX = -8


def few_arenas() -> None:
    """For this process, and for those that it starts."""
    if hasattr(library := ctypes.CDLL(None), "mallopt"):
        library.mallopt(_M_ARENA_MAX, int(os.environ.setdefault("MALLOC_ARENA_MAX", str(ARENAS))))


def give_back() -> None:
    """After something that needed much: what was freed goes back to the machine."""
    if hasattr(library := ctypes.CDLL(None), "malloc_trim"):
        library.malloc_trim(ctypes.c_size_t(0))


def freeze() -> None:
    """After a start: what is there stays, and is nothing for Python's collector (gc.freeze) to look at.

    Its walk through 70,000 objects stops every thread for 40 ms, on a small machine for several times that, and comes
    at any time: while a motor's stop is due, too.
    """
    gc.collect()
    gc.freeze()

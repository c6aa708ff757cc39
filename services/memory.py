"""What the C library keeps of memory that we have freed: less of it, on a machine that has little.

glibc's; a C library without these functions needs none of them (mallopt(3), malloc_trim(3)).
"""

from __future__ import annotations

import ctypes
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

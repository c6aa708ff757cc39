"""What can be wished of a scan, as it is ordered. Pure. How an order's value is read is in `orders.py`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ScanFor:
    """Look for these targets at these places, so many frames at each; None: as configured.

    `full`: every place, in both picture modes.
    """

    targets: tuple[int, ...] | None = None
    places: tuple[str, ...] | None = None
    full: bool = False
    frames: int | None = None

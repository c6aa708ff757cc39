"""Learning what a camera sees with and how it hangs: from a board that a person shows it, and from markers.

The reckoning is in `vision/calibrate_lens.py` and `vision/calibrate_mount.py`. Learning its motors is in `ptz/`.
"""

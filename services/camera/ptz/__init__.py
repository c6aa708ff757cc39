"""Turning the camera: its range, how its motors behave, moving to a pose, coming to rest, who has the motors."""

"""Turning the camera: its range, how its motors behave, moving to a pose, coming to rest, who has the motors.

From the outside in:
- Orders: `motors` (who has them), `trips` (moves, as they are ordered), `stand` (stops, motions by hand), `calibrate`
  and `zoom_sweeps` (learns the motors on purpose; `command` asks for it).
- A move: `move` (which part is next), `helm` (sends, comes to rest), `course` (where it is meanwhile), `goal`.
- By start and stop: `turning` (legs of pan and tilt), `leg` and `outlook` (which speeds), `zooming`; `homing` and
  `ladder` where a position ends pan and zoom alone.
- By the firmware itself: `driving` and `drive` (positions, presets), `hopping`, `rush` and `landing` (the relative
  form), `zoom_drive`, `glide` (how an axis goes there), `arriving` (that it rests).
- What is learnt: `skill` (all of it), `pace` (an axis), `zoom_rate`, `scale` and `planes` (the relative form); `kept`.
"""

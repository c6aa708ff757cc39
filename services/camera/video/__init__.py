"""Pictures of the camera: one connection, the newest frame, and the stream that others may look at."""

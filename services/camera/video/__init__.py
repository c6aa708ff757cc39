"""Pictures of the camera."""

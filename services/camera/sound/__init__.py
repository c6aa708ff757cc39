"""Sound: recordings from the camera's microphone, and files for its loudspeaker."""

"""The motion alarm: a thread that listens to the camera's events, and what is made of them."""

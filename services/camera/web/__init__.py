"""HTTP to a camera: the connection, its timeouts and its login. What is said over it is the brand's."""

"""Virtual time: the same services in one process on the memory bus, as fast as the machine allows.

`apartment` drives the services, `link` stands for the camera's threads, `wire` for the network to the camera. What
threads, processes and sockets do is shown on real parts, and a test compares the two.
"""

from services.virtual.apartment import VirtualApartment

__all__ = ["VirtualApartment"]

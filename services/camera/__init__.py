"""One camera: listens to `camera/<cam>/order/+`, `position/set` and `snapshot/get`; says where it looks, what became of
orders, and where in the apartment the markers are that a scan has found. The only one that talks to the camera.
"""

from services.camera.settings import Config
from services.camera.start import check, start

__all__ = ["Config", "check", "start"]

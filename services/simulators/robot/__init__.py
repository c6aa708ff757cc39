"""A robot that is not there: `service.py` on the bus; how it moves (`body.py`), finds its way (`route.py`) and sees
(`sight.py`), and the map that it has of the flat (`plan.py`).
"""

from services.simulators.robot.service import Config, check, start

__all__ = ["Config", "check", "start"]

"""The mission: robot and house find a marker together.

Listens to `mission/<robot>/order` and `/where`, to the robot (`robot/<robot>/...`) and to what the house's cameras
say (`camera/<cam>/marker/...`, `scan/result`, `order_result`, `status`). Says `mission/<robot>/state` and `/result`,
`robot/<robot>/goto` and `/cancel`, and orders scans.
"""

from services.mission.service import check, start
from services.mission.settings import Config

__all__ = ["Config", "check", "start"]

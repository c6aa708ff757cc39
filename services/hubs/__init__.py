"""Other hubs: Home Assistant and whatever speaks Homie learn from the bus what there is in the home.

Listens to states of the home, to what hubs want, and to what is retained of its own. Says `homeassistant/.../config`
and `homie/apartment/...`, where configured. A camera's discovery is the camera service's.
"""

from services.hubs.service import Config, start

__all__ = ["Config", "start"]

"""A camera on the network, as far as a program can tell: HTTP API, motors, pictures, alarms, and its firmware's ways.

Built from the facts about the API and from `world.yaml` alone: it must not import the camera service, which would
then be tested against its own opinions. From outside in: `http` (wire) -> `digest`, `device` -> `ptz`,
`config_tables`, `events` -> `motors`; `picture` -> `scene` -> `prints`, `solids`, `textures`, `optics`.
"""

from services.simulators.camera.program import Config, Simulated, serve, start

__all__ = ["Config", "Simulated", "serve", "start"]

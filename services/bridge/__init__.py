"""The bus and ROS 1: messages across by the rules of `config/bridge.yaml`, and back; lives through a new master.

Listens to the MQTT filters of the rules, to `diagnostics/#`, and to what the cameras say of where they look, what they
saw and where their picture is; on ROS to the topics of the rules towards MQTT. Says what the rules make of it,
`/diagnostics` once a second, frames, joints, pictures and the map, answers services, and says `diagnostics/bridge`.
"""

from services.bridge.program import Config, check, start

__all__ = ["Config", "check", "start"]

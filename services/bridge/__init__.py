"""The bus and ROS 1: messages across by the rules of `config/bridge.yaml`, and back; lives through a new master.

Listens to the MQTT filters of the rules and to `diagnostics/#`; on ROS to the topics of the rules towards MQTT.
Says what the rules make of it, `/diagnostics` once a second, and `diagnostics/bridge`.
"""

from services.bridge.program import Config, check, start

__all__ = ["Config", "check", "start"]

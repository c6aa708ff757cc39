"""OpenHAB's semantic model: which class a room, a device and an item have, where the home does not say it. Pure.

Only classes that every release from 3.0 on knows.
"""

from __future__ import annotations

from services.apartment.home import Home, Item, Room, Thing
from services.states import base_type

ROOM_WORDS = {
    "kitchen": "Kitchen",
    "living": "LivingRoom",
    "bedroom": "Bedroom",
    "bath": "Bathroom",
    "hall": "Corridor",
    "corridor": "Corridor",
    "office": "Office",
    "dining": "DiningRoom",
    "laundry": "LaundryRoom",
    "entry": "Entry",
    "garage": "Garage",
    "garden": "Garden",
    "terrace": "Terrace",
    "cellar": "Cellar",
    "attic": "Attic",
}
# The icon of an item says best what its device is.
EQUIPMENT_ICONS = {
    "light": "Lightbulb",
    "colorlight": "Lightbulb",
    "poweroutlet": "PowerOutlet",
    "motion": "MotionDetector",
    "door": "Door",
    "window": "Window",
    "rollershutter": "Blinds",
    "heating": "HVAC",
    "climate": "HVAC",
    "player": "Receiver",
    "temperature": "Sensor",
    "humidity": "Sensor",
}
PROPERTY_OF_DIMENSION = {
    "Temperature": "Temperature",
    "Power": "Power",
    "Energy": "Energy",
    "Pressure": "Pressure",
    "ElectricPotential": "Voltage",
    "ElectricCurrent": "Current",
    "Frequency": "Frequency",
}
PROPERTY_OF_ICON = {
    "light": "Light",
    "colorlight": "Light",
    "humidity": "Humidity",
    "motion": "Presence",
    "door": "Opening",
    "window": "Opening",
    "rollershutter": "Opening",
    "soundvolume": "SoundVolume",
    "time": "Timestamp",
}


def room_tag(key: str, room: Room) -> str:
    """The location's class."""
    if room.tag is not None:
        return room.tag
    return next((tag for word, tag in ROOM_WORDS.items() if word in key.lower()), "Room")


def equipment_tag(home: Home, key: str, thing: Thing) -> str:
    """The device's class: by the first of its items that says something."""
    if thing.tag is not None:
        return thing.tag
    icons = [item.icon or "" for item in home.items.values() if item.thing == key]
    return next((EQUIPMENT_ICONS[icon] for icon in EQUIPMENT_ICONS if icon in icons), "Equipment")


def point_tags(item: Item) -> tuple[str, ...]:
    """What an item is of its device, and of what property: `Measurement`, `Temperature`."""
    if item.tags is not None:
        return item.tags
    kind, _, dimension = item.type.partition(":")
    found = PROPERTY_OF_DIMENSION.get(dimension) or PROPERTY_OF_ICON.get(item.icon or "")
    return (_point(item, kind), *([found] if found else []))


def _point(item: Item, kind: str) -> str:
    if not item.takes_commands:
        return "Measurement" if kind == "Number" else "Status"
    if kind in ("Number", "String") and (item.range or item.options):
        return "Setpoint"
    return "Switch" if base_type(item.type) == "Switch" else "Control"

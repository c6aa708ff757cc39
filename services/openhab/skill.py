"""What the Alexa skill of OpenHAB knows: device types, their attributes, and which item types each goes with. Pure.

From the documentation of the skill (version 3). Not here: what is written for an item, that is `alexa.py`.
"""

from __future__ import annotations

GENERIC = ("Mode", "RangeValue", "ToggleState")
FAN = "PowerState FanSpeed FanDirection FanOscillate"
SOUND = (
    "PowerState VolumeLevel VolumeStep MuteState MuteStep EqualizerBass EqualizerMidrange EqualizerTreble "
    "EqualizerMode Channel ChannelStep Input Playback PlaybackStop"
)
BLIND = "OpenState PositionState TiltAngle TargetOpenState CurrentOpenState"
DOOR = "OpenState TargetOpenState CurrentOpenState"
LIGHT = "PowerState Brightness Color ColorTemperature"
SWITCH = "PowerState PowerLevel Percentage"
NETWORKED = "PowerState NetworkAccess"
MOBILE = "PowerState BatteryLevel NetworkAccess"
PANEL = (
    "ArmState BurglaryAlarm CarbonMonoxideAlarm FireAlarm WaterAlarm AlarmAlert ReadyAlert TroubleAlert ZonesAlert "
    "SafetyBeamAlert ChannelKey"
)
TYPES: dict[str, str] = {
    "Activity": "PowerState",
    "AirConditioner": f"{FAN} TargetTemperature CurrentTemperature",
    "AirFreshener": FAN,
    "AirPurifier": FAN,
    "AirQualityMonitor": "CurrentTemperature CurrentHumidity BatteryLevel",
    "Automobile": "BatteryLevel FanSpeed LockState PowerState TargetTemperature CurrentTemperature TargetLockState "
    "CurrentLockState",
    "AutomobileAccessory": "BatteryLevel CameraStream FanSpeed PowerState",
    **dict.fromkeys(("Blind", "Curtain", "Shade", "Shutter", "Awning"), BLIND),
    "BluetoothSpeaker": f"{SOUND} BatteryLevel",
    **dict.fromkeys(("Camera", "Doorbell"), "PowerState CameraStream BatteryLevel"),
    **dict.fromkeys(("Light", "ChristmasTree"), LIGHT),
    **dict.fromkeys(("CoffeeMaker", "Dishwasher", "Dryer", "Hub", "Microwave"), "PowerState"),
    **dict.fromkeys(("Oven", "Phone", "Printer", "SlowCooker", "Washer"), "PowerState"),
    **dict.fromkeys(("Computer", "GameConsole"), NETWORKED),
    "ContactSensor": "ContactDetectionState BatteryLevel",
    "Door": DOOR,
    "Fan": FAN,
    "GarageDoor": f"{DOOR} ObstacleAlert SafetyBeamAlert",
    "Headphones": f"{SOUND} BatteryLevel",
    **dict.fromkeys(("Laptop", "MobilePhone", "Tablet", "Wearable"), MOBILE),
    "Lock": "LockState TargetLockState CurrentLockState BatteryLevel",
    "MotionSensor": "MotionDetectionState BatteryLevel",
    **dict.fromkeys(("MusicSystem", "StreamingDevice", "Speaker", "Television", "Screen"), SOUND),
    **dict.fromkeys(("NetworkHardware", "Router"), "PowerState"),
    **dict.fromkeys(("Outlet", "Switch"), SWITCH),
    "Remote": f"{SOUND} Navigation ChannelKey BatteryLevel",
    "Scene": "PowerState",
    **dict.fromkeys(("SecurityPanel", "SecuritySystem"), PANEL),
    "TemperatureSensor": "CurrentTemperature BatteryLevel",
    "Thermostat": "HeatingCoolingMode TargetTemperature CoolingSetpoint HeatingSetpoint EcoCoolingSetpoint "
    "EcoHeatingSetpoint ThermostatHold ThermostatFan CurrentTemperature CurrentHumidity BatteryLevel",
    "VacuumCleaner": "PowerState VacuumMode FanSpeed BatteryLevel",
    "WaterHeater": "PowerState TargetTemperature CurrentTemperature",
    "Other": "",  # all
}
# Attribute -> the base item types that it works with; Number stands for every dimension.
ATTRIBUTES: dict[str, str] = {
    **dict.fromkeys(("OpenState", "TargetOpenState", "LockState", "TargetLockState"), "Switch"),
    "CurrentOpenState": "Contact Number String Switch",
    "CurrentLockState": "Contact Number String Switch",
    **dict.fromkeys(("ObstacleAlert", "SafetyBeamAlert"), "Contact Switch"),
    "PositionState": "Dimmer Rollershutter",
    "TiltAngle": "Dimmer Number Rollershutter",
    **dict.fromkeys(("Channel", "Input"), "Number String"),
    **dict.fromkeys(("ChannelStep", "VolumeStep", "MuteStep", "ChannelKey", "Navigation"), "String"),
    "VolumeLevel": "Dimmer Number",
    **dict.fromkeys(("MuteState", "PlaybackStop", "FanOscillate", "NetworkAccess"), "Switch"),
    **dict.fromkeys(("EqualizerBass", "EqualizerMidrange", "EqualizerTreble"), "Dimmer Number"),
    "EqualizerMode": "Number String",
    "Playback": "Player",
    "PlaybackStep": "String",
    "FanSpeed": "Dimmer Number String",
    "FanDirection": "String Switch",
    "Brightness": "Color Dimmer",
    "Color": "Color",
    "ColorTemperature": "Dimmer Number",
    **dict.fromkeys(("Scene", "Activity"), "Switch"),
    "ArmState": "Number String Switch",
    **dict.fromkeys(("BurglaryAlarm", "CarbonMonoxideAlarm", "FireAlarm", "WaterAlarm"), "Contact Switch"),
    **dict.fromkeys(("AlarmAlert", "ReadyAlert", "TroubleAlert", "ZonesAlert"), "Contact Switch"),
    **dict.fromkeys(("ContactDetectionState", "MotionDetectionState"), "Contact Switch"),
    **dict.fromkeys(("BatteryLevel", "CurrentHumidity"), "Dimmer Number"),
    **dict.fromkeys(("CurrentTemperature", "TargetTemperature"), "Number"),
    **dict.fromkeys(("CoolingSetpoint", "HeatingSetpoint", "EcoCoolingSetpoint", "EcoHeatingSetpoint"), "Number"),
    "PowerState": "Color Dimmer Number String Switch",
    "PowerLevel": "Dimmer",
    "Percentage": "Dimmer Rollershutter",
    "HeatingCoolingMode": "Number String Switch",
    "ThermostatHold": "Number String Switch",
    "ThermostatFan": "String Switch",
    "VacuumMode": "Number String",
    "CameraStream": "String",
    "Mode": "Number String Switch",
    "RangeValue": "Dimmer Number Rollershutter",
    "ToggleState": "Color Dimmer Number String Switch",
}
# What a device type alone means, by the item's type: the attributes of it that this type knows.
DEFAULTS: dict[str, str] = {
    **dict.fromkeys(("Light", "ChristmasTree"), "PowerState Brightness Color"),
    **dict.fromkeys(("Switch", "Outlet"), SWITCH),
    **dict.fromkeys(("Blind", "Curtain", "Shade", "Shutter", "Awning"), "OpenState PositionState"),
    **dict.fromkeys(("Door", "GarageDoor"), "OpenState"),
    **dict.fromkeys(("Camera", "Doorbell"), "PowerState CameraStream"),
    **dict.fromkeys(("Fan", "AirFreshener", "AirPurifier"), "PowerState FanSpeed"),
    **dict.fromkeys(("Speaker", "BluetoothSpeaker", "Headphones"), "PowerState VolumeLevel"),
    **dict.fromkeys(("StreamingDevice", "MusicSystem"), "PowerState Playback"),
    **dict.fromkeys(("Television", "Screen", "Remote"), "PowerState Channel"),
    **dict.fromkeys(("SecurityPanel", "SecuritySystem"), "ArmState"),
    "ContactSensor": "ContactDetectionState",
    "MotionSensor": "MotionDetectionState",
    "TemperatureSensor": "CurrentTemperature",
    "Thermostat": "HeatingCoolingMode",
    "Lock": "LockState",
    "VacuumCleaner": "PowerState VacuumMode",
    "Scene": "Scene",
    "Activity": "Activity",
    "AirQualityMonitor": "",
    "Automobile": "",
    "AutomobileAccessory": "",
    "Other": "",
}
OLD_TAGS = (  # of the skill's version 2, for OpenHAB 2.x
    "Lighting", "Switchable", "ContactSensor", "MotionSensor", "CurrentTemperature", "CurrentHumidity", "Thermostat",
    "TargetTemperature", "homekit:HeatingCoolingMode", "WindowCovering", "Fan", "Lock", "Outlet", "Scene", "Activity",
)  # fmt: skip
MOST_ENDPOINTS = 300
MODES = (2, 150)


def attributes_of(device: str) -> tuple[str, ...]:
    """The attributes that a device type supports; every one of `Other`."""
    return (*(TYPES[device].split() or ATTRIBUTES), *GENERIC)


def defaults_of(device: str, base: str) -> tuple[str, ...]:
    """The attributes that a device type alone gives an item of this base type."""
    names = DEFAULTS.get(device, "PowerState").split()
    return tuple(one for one in names if base in ATTRIBUTES[one].split())

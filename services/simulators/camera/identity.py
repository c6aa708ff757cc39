"""What the camera says of itself: model, versions, card, microphone and speaker. Pure.

Which models answer what is known in part only; keys that no source shows are inferred.
"""

from __future__ import annotations

from services.simulators.camera.config_tables import Tables
from services.simulators.camera.messages import Answer, Request, lines, refusal
from services.simulators.camera.profiles import Profile

CARD_BYTES, CARD_USED = 31_902_400_512.0, 12_582_912_000.0


class Identity:
    """One camera's answers about itself. `card` says whether a memory card is in it."""

    def __init__(self, profile: Profile, serial: str, tables: Tables) -> None:
        self._profile, self._serial, self._tables = profile, serial, tables
        self.card = True

    def magic_box(self, request: Request, now: float) -> Answer:
        """`magicBox.cgi`, as far as it only tells."""
        profile = self._profile
        version = [f"version={profile.firmware}", f"BuildDate={profile.built}"]
        if profile.version_form == "one line":
            version = [f"version={profile.firmware},build:{profile.built}"]
        facts = {
            "getDeviceType": [f"type={profile.model}"],
            "getSerialNo": [f"sn={self._serial}"],
            "getSoftwareVersion": version,
            "getHardwareVersion": ["version=1.00"],
            "getMachineName": [f"name={self._tables.text('General.MachineName')}"],
            "getVendor": ["vendor=Amcrest"],
            "getDeviceClass": ["deviceClass=IPC"],
            "getSystemInfo": self._system(),
        }
        if request.action == "getProductDefinition" and request.text("name") == "MaxExtraStream":
            return lines(["table.MaxExtraStream=2"])
        if request.action == "getDeviceClass" and not profile.device_class:
            return refusal(profile)
        return lines(facts[request.action]) if request.action in facts else refusal(profile)

    def _system(self) -> list[str]:
        model = self._profile.model
        facts = {"appAutoStart": "true", "deviceType": model, "hardwareVersion": "1.00", "processor": "SSC327DE"}
        return [f"{key}={value}" for key, value in (facts | {"serialNumber": self._serial}).items()]

    def versions(self, request: Request, now: float) -> Answer:
        """`IntervideoManager.cgi`: of the HTTP API and of ONVIF."""
        known = request.action == "getVersion" and request.text("Name") in ("CGI", "Onvif")
        return lines(["version=1.40"]) if known else refusal(self._profile)

    def storage(self, request: Request, now: float) -> Answer:
        """`storageDevice.cgi`: the card; refused when there is none."""
        if request.action != "getDeviceAllInfo" or not self.card:
            return refusal(self._profile)
        part = {"IsError": "false", "Path": "/mnt/sd", "TotalBytes": f"{CARD_BYTES:.1f}", "Type": "ReadWrite"}
        part |= {"UsedBytes": f"{CARD_USED:.1f}"}
        detail = [f"list.info[0].Detail[0].{key}={value}" for key, value in part.items()]
        return lines([*detail, "list.info[0].Name=/dev/mmc0", "list.info[0].State=Success"])

    def sound_devices(self, request: Request, now: float) -> Answer:
        """`devAudioInput.cgi` and `devAudioOutput.cgi`: one of each."""
        return lines(["result=1"]) if request.action == "getCollect" else refusal(self._profile)

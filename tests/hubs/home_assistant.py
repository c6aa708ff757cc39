"""The real Home Assistant finds the simulated apartment and switches its light. Outside the ordinary tests.

    python -m venv ha && ha/bin/pip install homeassistant==2024.3.3 paho-mqtt==1.6.1 PyTurboJPEG==1.7.1 janus==1.0.0 \\
        psutil-home-assistant==0.0.1 SQLAlchemy==2.0.28 home-assistant-frontend==20240307.0 hassil==1.6.1
    python -m tests.hubs.home_assistant ha/bin/python
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from services.config import load
from services.peers import free_port, mosquitto
from services.simulated import CONFIG
from services.supervisor import Supervisor, commands, in_background, processes

SERVICES = ("simulated-home", "simulated-camera", "camera-ip1", "hubs")
CALLS: list[list[Any]] = [  # entity, domain, service, data, the state that it has to lead to
    ["apartment_home_Kitchen_Light", "light", "turn_on", {}, "on"],
    ["apartment_home_Hall_Dimmer", "light", "turn_on", {"brightness_pct": 40}, "on"],
    ["apartment_home_Lamp_Color", "light", "turn_on", {"hs_color": [0, 100]}, "on"],
    ["apartment_home_Bedroom_Shutter", "cover", "close_cover", {}, "closed"],
    ["apartment_home_Bedroom_Setpoint", "number", "set_value", {"value": 21.5}, "21.5"],
    ["apartment_home_Bedroom_Mode", "select", "select_option", {"option": "Cooler"}, "Cooler"],
    ["apartment_ip1_place", "select", "select_option", {"option": "Kitchen"}, "Kitchen"],
]
SEEN = ("apartment_ip1_snapshot", "apartment_ip1_motion", "apartment_ip1_place", "apartment_home_Lab_Temp",
        "apartment_home_Front_Door")  # fmt: skip


def environment(folder: Path) -> dict[str, str]:
    """What `config/simulated.yaml` wants to know."""
    ports = ("BROKER_PORT", "CAMERA_PORT", "CAMERA_RTSP_PORT", "SIDE_DOOR_PORT")
    fixed = {"APARTMENT_STATE": str(folder / "state"), "APARTMENT_DATABASE": f"sqlite:///{folder}/bus.db",
             "APARTMENT_WITHOUT_ROS": "true"}  # fmt: skip
    return {**fixed, **{f"APARTMENT_{name}": str(free_port()) for name in ports}}


def configuration(folder: Path) -> Path:
    """The simulated apartment, with discovery."""
    config = folder / "config" / "simulated.yaml"
    shutil.copytree(CONFIG, config.parent)
    text = config.read_text(encoding="utf-8").replace(
        "    brand: amcrest\n", "    brand: amcrest\n    discovery: true\n", 1
    )
    config.write_text(text + "\nhubs: {home_service: simulated-home}\n", encoding="utf-8")
    return config


def trial(python: str, folder: Path) -> dict[str, Any]:
    """What Home Assistant says of the apartment."""
    given = environment(folder)
    with ExitStack() as stack:
        port = int(given["APARTMENT_BROKER_PORT"])
        stack.enter_context(mosquitto.private(folder / "mosquitto", port=port, anonymous=True))
        config = configuration(folder)
        apartment = load(config, environment={**os.environ, **given})
        running = commands(processes(apartment, list(SERVICES)), config)
        stack.enter_context(in_background(Supervisor(running, given, folder / "services.log")))
        wanted = json.dumps({"entities": [*SEEN, *(one[0] for one in CALLS)], "calls": CALLS})
        inside = Path(__file__).with_name("inside_home_assistant.py")
        words = [python, str(inside), str(port), str(folder / "home_assistant"), wanted]
        done = subprocess.run(words, capture_output=True, text=True, timeout=600, cwd=folder)
    line = next((line for line in done.stdout.splitlines() if line.startswith("TRIAL ")), None)
    if line is None:
        sys.exit(f"Home Assistant ended with {done.returncode}:\n{done.stderr[-3000:]}")
    result: dict[str, Any] = json.loads(line.removeprefix("TRIAL "))
    return result


def main() -> None:
    """Tells what was found and whether every call did what it should; ends with 1 when one did not."""
    with tempfile.TemporaryDirectory(prefix="apartment-ha-") as folder:
        result = trial(sys.argv[1], Path(folder))
    wrong = [one[0] for one in CALLS if result["calls"].get(one[0]) != one[4]]
    wrong += [one for one in SEEN if result["states"].get(one) in (None, "unavailable")]
    sys.stdout.write("".join(f"{name}: {state}\n" for name, state in sorted(result["states"].items())))
    sys.stdout.write(f"{len(result['states'])} entities, {len(CALLS)} calls, wrong: {', '.join(wrong) or 'none'}\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()

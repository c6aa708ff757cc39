"""What happens to a motion when `apartment probe` ends in the middle of it, and that nothing turns untold."""

from __future__ import annotations

import re
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import Popen
from typing import Any, Literal

import httpx
import pytest

from services import peers
from services.camera.device import Away, Direction
from services.simulators import camera as simulated
from services.simulators.camera import aims
from services.simulators.camera.firmwares import PROFILES
from services.simulators.camera.profiles import Profile
from services.simulators.camera.program import Inside, inside
from tests.camera import trials
from tests.camera.bench import PASSWORD, SHIPPED, simulator
from tests.camera.first_contact import Network, config, probed
from tests.small_flat import Door

RUN = "action=start&channel=1&code=Left&arg1=0&arg2=3&"  # one of the longer ones
DRIVEN = "action=start&channel=1&code=PositionABS&"
MET_S = 90.0  # all that is only read is asked before


@contextmanager
def probing(camera: simulated.Simulated, folder: Path, motion: str) -> Iterator[tuple[Popen[bytes], Door]]:
    """`apartment probe` as a process, in the middle of such a motion."""
    door = Door(camera.side_door_url)
    door.tell("pose", pan=90.0, tilt=20.0)
    words = ["probe", "ip9", "--url", camera.url, "--user", "ros", "--yes-move", "--out", str(folder / "papers")]
    environment = {"PYTHONPATH": str(SHIPPED.parent), "CAMERA_IP9_PASSWORD": PASSWORD}

    def there() -> bool:
        orders = [one["target"] for one in door.log() if re.search("action=(start|stop)", one["target"])]
        return orders[-1:] != [] and motion in orders[-1] and door.moving

    command = [sys.executable, "-m", "services", *words]
    with peers.running(command, folder / "log", lambda: True, environment) as process:
        peers.wait_until(there, motion, MET_S)
        yield process, door


def far(request: Any, profile: Profile, stand: aims.Stand) -> aims.Drive:
    """Firmware that takes the numbers for something else."""
    return aims.Drive(aims.travel(stand.pose._replace(pan=stand.pose.pan + 150.0)), level=3)


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGTERM, 1), (signal.SIGHUP, 1)]
)
def test_the_motor_stands_still_soon_after_the_probe_was_killed_or_told_to_end_or_its_terminal_was_closed(
    tmp_path: Path, number: signal.Signals, code: int
) -> None:
    with simulator(latency_s=0.03, rtsp_port=None) as camera, probing(camera, tmp_path, RUN) as (process, door):
        process.send_signal(number)
        assert trials.until_still(door) < trials.STOPPED_S
        assert process.wait(10.0) == code
        trials.rests(door)


def test_so_it_does_where_the_firmware_drives_and_elsewhere_than_it_was_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(aims.COMMANDS, "PositionABS", (lambda profile: True, far))
    switches = {"position_abs": "full"}
    with (
        simulator(latency_s=0.03, rtsp_port=None, switches=switches) as camera,
        probing(camera, tmp_path, DRIVEN) as (process, door),
    ):
        process.kill()
        assert trials.until_still(door) < trials.STOPPED_S
        trials.rests(door)


class Watched(Network):
    """Remembers what turned although nobody was told, by the request that was on its way then."""

    def __init__(self, inside: Inside) -> None:
        super().__init__(inside)
        self.told: list[Direction | Literal["drive"] | None] = [None]
        self.untold: list[str] = []
        self.turned = False

    def turning(self, what: Direction | Literal["drive"] | None) -> None:
        self.look(f"told of {what}")
        self.told.append(what)
        self.look(f"told of {what}")

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        self.look(str(request.url))
        answer = super().handle_request(request)
        self.look(str(request.url))
        return answer

    def look(self, what: str) -> None:
        turns = any(self.inside.device.motion(self.now)[1])
        self.turned = self.turned or turns
        if turns and self.told[-1] is None:
            self.untold.append(what)


@pytest.mark.parametrize("profile", PROFILES)
def test_whatever_turns_is_told_before_and_until_it_stands(profile: str) -> None:
    network = Watched(inside(config(profile=profile), 0.0))
    probed(network)
    assert network.turned
    assert network.untold == []
    assert network.told[-1] is None


@pytest.mark.parametrize("command", ["PositionABS", "moveAbsolutely"])
def test_so_is_what_leads_elsewhere(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(aims.COMMANDS, command, (lambda profile: True, far))
    network = Watched(inside(config(), 0.0))
    probed(network)
    assert network.untold == []
    assert network.told[-1] is None


@pytest.mark.parametrize("command", ["Position", "Continuously", "moveRelatively"])
def test_what_does_not_come_to_rest_is_left_to_whoever_ends_it(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """None of these was asked to turn it."""
    monkeypatch.setitem(aims.COMMANDS, command, (lambda profile: True, far))
    network = Watched(inside(config(), 0.0))
    with pytest.raises(Away, match="does not come to rest"):
        probed(network)
    assert network.untold == []
    assert network.told[-1] == "drive"


class Rightless(Watched):
    """A camera that this account may not turn."""

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        if "Authorization" in request.headers and b"action=start" in request.url.query:
            return httpx.Response(401, stream=httpx.ByteStream(b"Error\r\nInvalid Authority!\r\n"))
        return super().handle_request(request)


def test_what_was_not_allowed_to_start_need_not_be_stopped() -> None:
    network = Rightless(inside(config(), 0.0))
    probed(network)
    assert any(network.told)
    assert network.told[-1] is None

"""Trials of cameras on real parts that the tests make once and the soak many times.

Each does something bad, asserts what is promised about it, and returns the figure that people want to see.
"""

from __future__ import annotations

import json
import os
import re
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from statistics import median
from typing import Any

from services import peers
from services.bus import Message
from services.client import Client
from services.payloads import CameraStatus, Order
from services.topics import CAMERA_ORDER, read
from tests.small_flat import Door, SmallFlat, end_orphans, family

NOTICED_S = 15.0  # a fault shows in the status within this
STOPPED_S = 1.5  # after whatever died: the motor stands still
REACHED_S = 1.0  # after the network is back: the stop reaches the camera
FAULTY: dict[str, Any] = {  # a camera for the faults: it boots quickly, and everything about it is switched on
    "simulator": {"latency_s": 0.1, "switches": {"boot_s": 4.0}},
    "camera": {"login_retry_s": 12.0, "stream": {"rtsp": True}},
}
ORDERS = (("Flip", "True"), ("Goto", "Sofa"), ("Move", "Left 3 0.3"), ("Goto", "Living room"))
TURNS = 3  # of these orders per camera: before, while, and after


@dataclass(frozen=True)
class Slowdown:
    """How much longer orders take than without the trouble: the ratio of the medians, and of 95 in 100."""

    median: float
    most: float


def hang(flat: SmallFlat, victim: str) -> Slowdown:
    """One of several cameras answers nobody; how much longer the orders of the others take then."""
    others = [name for name in flat.doors if name != victim]
    with flat.client("camera/+/order_result", "camera/+/status") as bus:
        durations(bus, others, 1)  # their first moves take longer: speeds are learnt
        calm = durations(bus, others, TURNS)
        flat.doors[victim].tell("freeze", on=True)
        try:
            bus.say(f"camera/{victim}/order/Move", "Left 2 20")  # so that something of it is on its way all the time
            during = durations(bus, others, TURNS)
            bus.payload(f"camera/{victim}/status", lambda status: status.state != "online", NOTICED_S)
            during += durations(bus, others, TURNS)
        finally:
            flat.doors[victim].tell("freeze", on=False)
        lost = [name for name in others if not online(bus, name)]
        bus.forget()
        bus.payload(f"camera/{victim}/status", lambda status: status.state == "online", 30.0)
        takes_orders(bus, victim)
        calm += durations(bus, others, TURNS)
    assert lost == []
    return slowdown(calm, during)


Durations = list[tuple[tuple[str, str, str], float]]  # camera, key and value of an order, and the seconds it took


def durations(bus: Client, cameras: list[str], turns: int) -> Durations:
    """Seconds from an order to its end, each of `ORDERS` in turn, given to all of these cameras at once."""
    found: Durations = []
    for key, value in ORDERS * turns:
        began = time.time()
        given = {f"{name}-{len(found)}-{began}": name for name in cameras}
        for order_id, name in given.items():
            bus.publish(CAMERA_ORDER.message(Order(value=value, id=order_id), cam=name, key=key))
        while given:
            end = bus.until(partial(ends, given), 60.0, f"the end of {key} {value}")
            result = read(end, end.received).payload
            assert result.state == "done", result
            found.append(((given.pop(result.id), key, value), end.received - began))
        bus.seen[:] = [message for message in bus.seen if message.topic.endswith("/status")]
    return found


def ends(given: Mapping[str, str], message: Message) -> bool:
    """Whether it ends one of these orders."""
    if not message.topic.endswith("/order_result"):
        return False
    result = read(message, message.received).payload
    return result.final and result.id in given


def slowdown(calm: Durations, during: Durations) -> Slowdown:
    """Each duration over the usual one of the same order to the same camera: long and short ones count alike."""
    usual = {order: median(seconds for one, seconds in calm if one == order) for order, _ in calm}
    before, then = (sorted(seconds / usual[order] for order, seconds in some) for some in (calm, during))
    most = [each[int(0.95 * len(each))] for each in (before, then)]
    return Slowdown(median(then) / median(before), most[1] / most[0])


def online(bus: Client, camera: str) -> bool:
    """Whether the newest status of a camera, as far as it was heard, says so."""
    return b'"online"' in newest(bus, f"camera/{camera}/status")


def newest(bus: Client, topic: str) -> bytes:
    """The newest payload that was heard there."""
    said: list[Any] = [message.payload for message in bus.seen if message.topic == topic]
    return bytes(said[-1]) if said else b""


@dataclass(frozen=True)
class Motion:
    """What turns a camera; how many degrees it has turned in the middle of it; what the camera is asked for then."""

    topic: str
    payload: str
    degrees: float
    asked: str


GOAL = '{"pan": 250, "tilt": 40}'  # the long way round: the dead arc is between
MOVE = Motion("order/Move", "Left 2 20", 3.0, "action=start&channel=1&code=Left&")
REGULATED = Motion("position/set", GOAL, 30.0, r"action=start&channel=1&code=(Left|Right)")  # start, look, stop
DRIVEN = Motion("position/set", GOAL, 30.0, "action=moveAbsolutely&")  # the firmware does it
MOVING: Mapping[str, Motion] = {"ip1": MOVE}
TIMED_S = 4.0
TIMED = Motion("order/Move", f"Left 2 {TIMED_S:.0f}", 3.0, "action=start&channel=1&code=Continuously&")
EVERY_MOTION: dict[str, Any] = {"cameras": ("ip1", "driving"), "firmware": {"driving": "sd2a-2023"}}
GOALS: Mapping[str, Motion] = {"ip1": REGULATED, "driving": DRIVEN}


def kill_service(
    flat: SmallFlat, moving: Mapping[str, Motion] = MOVING, *, first: Callable[[int, Door], None] = lambda *_: None
) -> float:
    """kill -9 of the cameras' services in the middle of their motions; seconds until every motor stands still.

    `first`: what happens to each service, at its camera's door, before that and while the motors turn.
    """
    doors = [flat.doors[camera] for camera in moving]
    services = [flat.pid(f"camera-{camera}") for camera in moving]
    with flat.client("service/+/status", "camera/#") as bus:
        turn(bus, flat, moving)
        bus.forget()
        for service, door in zip(services, doors, strict=True):
            first(service, door)
        for service in services:
            os.kill(service, signal.SIGKILL)
        seconds = until_still(*doors)
        for status in (f"service/camera-{camera}/status" for camera in moving):
            bus.until(lambda said, of=status: said[:2] == (of, b"offline"), 10.0, "the last will")  # type: ignore[misc]
            wait(bus, lambda status=status: newest(bus, status) == b"online", 20.0, "a new one")  # type: ignore[misc]
        rests(*doors)
        for camera in moving:
            wait(bus, lambda camera=camera: online(bus, camera), 5.0, "the new one to have met the camera")  # type: ignore[misc]
            takes_orders(bus, camera)
    return seconds


def kill_watchdog(flat: SmallFlat, moving: Mapping[str, Motion] = MOVING) -> float:
    """kill -9 of the watchdogs first, and of the services when other ones are at work."""
    return kill_service(flat, moving, first=_lose_watchdog)


def _lose_watchdog(service: int, door: Door) -> None:
    """Returns when another one has logged in: nobody else asks where it looks without a login meanwhile."""
    logins = partial(_challenged, door)
    before, (_, watchdog) = logins(), family(service)
    os.kill(watchdog, signal.SIGKILL)
    peers.wait_until(lambda: logins() > before, "another watchdog", 10.0)
    assert door.moving


def _challenged(door: Door) -> int:
    return sum(entry["status"] == 401 and "getStatus" in entry["target"] for entry in door.log())


def end_service(flat: SmallFlat, *, camera: str = "ip1") -> float:
    """SIGTERM for the service in the middle of a move; seconds until the motor stands still. Its order has an end."""
    door, service = flat.doors[camera], flat.pid(f"camera-{camera}")
    with flat.client(f"service/camera-{camera}/status", f"camera/{camera}/#") as bus:
        turn(bus, flat, {camera: MOVING[camera]})
        os.kill(service, signal.SIGTERM)
        seconds = until_still(door)
        ended = bus.payload(f"camera/{camera}/order_result", lambda result: result.final, 10.0)
        assert (ended.key, ended.state, ended.error) == ("Move", "cancelled", "the service ends")
        bus.payload(f"service/camera-{camera}/status", lambda text: text == "offline", 10.0)
    flat.start_services()
    return seconds


def kill_supervisor(flat: SmallFlat, moving: Mapping[str, Motion] = MOVING) -> float:
    """kill -9 of the supervisor in the middle of motions; seconds until the motors stand still. Nobody is left over."""
    doors, everybody = [flat.doors[camera] for camera in moving], flat.processes
    assert len(everybody) > 2, "the supervisor, a service and a watchdog"
    with flat.client("camera/#") as bus:
        turn(bus, flat, moving)
        os.kill(flat.process.pid, signal.SIGKILL)
        seconds = until_still(*doors)
        end_orphans(everybody)
        rests(*doors)
    flat.start_services()
    return seconds


def kill_broker(flat: SmallFlat, moving: Mapping[str, Motion] = MOVING) -> float:
    """kill -9 of the broker in the middle of motions; seconds until the motors stand still. Then all is as before."""
    doors = [flat.doors[camera] for camera in moving]
    with flat.client("camera/#") as bus:
        turn(bus, flat, moving)
    with flat.without_broker(signal.SIGKILL):
        seconds = until_still(*doors)
        rests(*doors)
    with flat.client("camera/#", "diagnostics/#") as bus:
        for camera in moving:
            speaks(bus, camera)
            bus.payload(f"camera/{camera}/status", lambda status: status.state == "online", 20.0)
            takes_orders(bus, camera)
    return seconds


def cut_network(flat: SmallFlat, *, camera: str = "ip1", seconds: float = 0.0, video_s: float = 0.0) -> float:
    """The network goes in the middle of a move, and comes back `seconds` after that was noticed.

    The camera turns on; the stop is the first that reaches it, although its video could be had `video_s` sooner.
    Seconds from the return until then.
    """
    door, net = flat.doors[camera], flat.networks[camera]
    with flat.client(f"camera/{camera}/#") as bus:
        turn(bus, flat, {camera: replace(MOVE, payload="Left 2 6")})
        with without_network(flat, bus, camera):
            cut = time.time()
            stays_degraded(bus, camera, seconds)
            if video_s:
                net.video.mend()
                bus.collect(video_s)
                bus.forget()
            assert door.moving, "a camera without a network turns on"
            met = len(door.log())
        back = time.time()
        peers.wait_until(lambda: len(door.log()) > met, "a request", 10.0)
        first = door.log()[met]
        looked = [round(when - back, 3) for when in net.video.spoke if cut < when < first["time"]]
        until_still(door)
        well_again(bus, door, camera)
    assert "action=stop" in first["target"], f"the first request was {first['target']}"
    reached = float(first["time"]) - back
    assert not looked, f"somebody wanted its picture before that, at {looked}"
    knocked = [round(when - back, 3) for when in net.web.let_in if when > back]
    assert reached < REACHED_S, f"{reached:.3f} s after the return; connections were let in at {knocked}"
    return reached


def cut_timed_move(flat: SmallFlat, *, camera: str = "driving") -> float:
    """The network goes in the middle of a move that the firmware times, and nothing gets there until that has ended.

    Seconds from the cut until the motor stands still.
    """
    door = flat.doors[camera]
    with flat.client(f"camera/{camera}/#") as bus:
        turn(bus, flat, {camera: TIMED})
        with without_network(flat, bus, camera):
            met = len(door.log())
            seconds = until_still(door)
            stays_degraded(bus, camera, 4.0)
            rests(door)
            assert door.log()[met:] == []
        well_again(bus, door, camera)
    return seconds


@contextmanager
def without_network(flat: SmallFlat, bus: Client, camera: str) -> Iterator[None]:
    """The network between a camera and its service is cut until the end of the block."""
    bus.forget()
    flat.networks[camera].cut()
    try:
        yield
    finally:
        flat.networks[camera].mend()


def stays_degraded(bus: Client, camera: str, seconds: float) -> None:
    """The status tells of the lost camera in time, and says nothing else for so many seconds then."""
    bus.payload(f"camera/{camera}/status", lost_in_a_move, NOTICED_S)
    bus.collect(seconds)
    said = [json.loads(message.payload)["state"] for message in bus.seen if message.topic == f"camera/{camera}/status"]
    assert set(said[said.index("degraded") :]) == {"degraded"}, said
    bus.forget()


def well_again(bus: Client, door: Door, camera: str) -> None:
    """The camera is online, nothing turns, and it takes orders."""
    bus.payload(f"camera/{camera}/status", lambda status: status.state == "online", 15.0)
    rests(door)
    takes_orders(bus, camera)


def lost_in_a_move(status: CameraStatus) -> bool:
    """Whether it says that the camera is lost while it turns; without its stream alone it is degraded too."""
    return status.state == "degraded" and "no answer from the camera" in status.reason


@contextmanager
def watched(flat: SmallFlat, *, camera: str = "ip1") -> Iterator[None]:
    """Its stream is on, and a picture has come; in the end it was asked for another time."""
    spoke = flat.networks[camera].video.spoke
    with flat.client(f"camera/{camera}/order_result") as bus:
        assert bus.order(camera, "RTSP", "True").state == "done"
        began = len(spoke)
        yield
        peers.wait_until(lambda: len(spoke) > began, "the stream to be opened again", 20.0)
        assert bus.order(camera, "RTSP", "False").state == "done"


def speaks(bus: Client, camera: str) -> None:
    """A camera's service is there: what a broker kept over its death says nothing about that, what is new does."""
    topic = f"diagnostics/camera/{camera}"
    bus.until(lambda message: message.topic == topic and not message.retain, 20.0, "the service to say something new")


def takes_orders(bus: Client, camera: str) -> None:
    """An order is carried out."""
    result = bus.order(camera, "Flip", "True")
    assert result.state == "done", result


def turn(bus: Client, flat: SmallFlat, moving: Mapping[str, Motion]) -> None:
    """Lets cameras turn, one after the other, the last ones quickest; then each is in the middle of its motion."""
    met = {}
    for camera in moving:
        flat.doors[camera].tell("pose", pan=90.0, tilt=20.0)
    for camera in moving:
        bus.payload(f"camera/{camera}/position", lambda position: abs(position.pan - 90.0) < 1, 5.0)
        met[camera] = len(flat.doors[camera].log())
    for camera, motion in moving.items():
        bus.say(f"camera/{camera}/{motion.topic}", motion.payload)
        peers.wait_until(lambda one=(flat.doors[camera], motion): midway(*one), f"{camera} to turn", 10.0)  # type: ignore[misc]
        asked = [entry["target"] for entry in flat.doors[camera].log()[met[camera] :]]
        assert any(re.search(motion.asked, target) for target in asked), asked
    assert all(flat.doors[camera].moving for camera in moving)


def midway(door: Door, motion: Motion) -> bool:
    """Whether a camera is in the middle of it."""
    state = door.state()
    return apart(state["pose"]["pan"], 90.0) > motion.degrees and bool(state["moving"])


def until_still(*doors: Door) -> float:
    """Seconds until every motor stands still."""
    began = time.monotonic()
    peers.wait_until(lambda: not any(door.moving for door in doors), "the motors to stand still", 10.0)
    return time.monotonic() - began


def rests(*doors: Door) -> None:
    """Nothing moves for a second: nobody starts anything."""
    poses, end = [door.state()["pose"] for door in doors], time.monotonic() + 1.0
    while time.monotonic() < end:
        assert not any(door.moving for door in doors)
    assert [door.state()["pose"] for door in doors] == poses


def apart(one: float, other: float) -> float:
    """Degrees between two pan readings."""
    return abs((one - other + 180) % 360 - 180)


KILLS = (kill_service, kill_watchdog, kill_supervisor, kill_broker)
MOTIONS = (MOVING, GOALS)


@dataclass(frozen=True)
class Fault:
    """What goes wrong, by its name at the side door; how the camera's status reads then; what else shows it."""

    name: str
    states: tuple[str, ...]
    settings: Mapping[str, object] = field(default_factory=dict)
    also: str = ""  # another order of the side door, at the same time
    asked: str = ""  # on this topic of the camera, at the same time: nothing shows it before
    meanwhile: Callable[[Client], None] = lambda bus: None  # what has to hold while it lasts
    shows: Callable[[Client], bool] = lambda bus: True  # besides the status; it is asked until it holds
    logged: Callable[[list[dict[str, Any]]], bool] = lambda log: True  # and in the requests that the camera met since
    back_s: float = 20.0  # after its end: everything is well again
    restarts: bool = False  # it is told afterwards that the camera has restarted

    def __str__(self) -> str:
        return self.name


def alarm_in_trouble(bus: Client) -> bool:
    """Whether the motion alarm says that it does not work."""
    return b'"value":-1' in newest(bus, "camera/ip1/motion")


def met(bus: Client) -> bool:
    """Whether the camera has said who it is, and its alarm has given a sign of life: only then silence is a fault."""
    said = newest(bus, "diagnostics/camera/ip1")
    values = json.loads(said)["values"] if said else {}
    return bool(values.get("firmware")) and values.get("alarm") == "attached"


def rebooted(bus: Client) -> str:
    """When the camera restarted, as the diagnostics tell; nothing when they do not."""
    said = newest(bus, "diagnostics/camera/ip1")
    return str(json.loads(said)["values"].get("rebooted", "")) if said else ""


def slow_answers(bus: Client) -> bool:
    """Whether the diagnostics tell of slow answers."""
    said = newest(bus, "diagnostics/camera/ip1")
    return bool(said) and float(json.loads(said)["values"]["http_latency_ms"]) > 500


def bad_snapshots(bus: Client) -> bool:
    """Whether the diagnostics warn that the camera's snapshots are no pictures, and count them."""
    said = newest(bus, "diagnostics/camera/ip1")
    told = json.loads(said) if said else {"message": "", "level": 0, "values": {}}
    return "no snapshot: " in told["message"] and told["level"] >= 1 and int(told["values"]["failed_snapshots"]) > 0


def good_snapshots(bus: Client) -> bool:
    """Whether the diagnostics have nothing to say against the camera's snapshots."""
    said = newest(bus, "diagnostics/camera/ip1")
    return bool(said) and "no snapshot: " not in json.loads(said)["message"]


def stays_usable(bus: Client) -> None:
    """Orders are done; one may fail with the reason. Nobody takes it for a wrong password."""
    results = []
    for _ in range(8):
        wait(bus, lambda: state_of(bus, "ip1") == "online", 10.0, "online")
        results.append(bus.order("ip1", "Flip", "True"))
    lost = [result.error for result in results if result.state != "done"]
    assert len(lost) <= 2, lost
    assert all("at random" in (error or "") for error in lost), lost
    said = [message.payload for message in bus.seen if message.topic == "camera/ip1/status"]
    assert not [payload for payload in said if b"bad_login" in payload or b"locked" in payload]


def ordered(bus: Client) -> bool:
    """Something of it is on its way."""
    return bus.order("ip1", "Flip", "True").final


def repeated(log: list[dict[str, Any]]) -> bool:
    """Whether a good login was refused, and the same request was answered when it came again."""
    refused = [at for at, one in enumerate(log) if one["authorized"] and one["status"] == 401]
    again = [[(one["target"], one["status"]) for one in log[at + 1 :]] for at in refused]
    return any((log[at]["target"], 200) in later for at, later in zip(refused, again, strict=True))


def is_told_why(bus: Client) -> bool:
    """Whether an order that the account has no right to give is answered so, while the camera stays online."""
    result = bus.order("ip1", "Move", "Left 1 0.2")
    told = result.state in ("refused", "failed") and "right" in (result.error or "")
    return told and state_of(bus, "ip1") == "online"


def refused_motion(log: list[dict[str, Any]]) -> bool:
    """Whether the camera has refused to turn for want of rights, and has turned for nobody."""
    starts = [one["status"] for one in log if "ptz.cgi?action=start" in one["target"]]
    return 401 in starts and 200 not in starts


def shows_no_half_picture(bus: Client) -> None:
    """Who asks for a picture gets a whole one or none."""
    bus.say("camera/ip1/snapshot/get", "now")
    bus.collect(4.0)
    pictures = [message.payload for message in bus.seen if message.topic == "camera/ip1/snapshot"]
    assert all(picture.endswith(b"\xff\xd9") for picture in pictures), [len(picture) for picture in pictures]


FAULTS = (
    Fault("drop", ("offline",), also="drop", shows=alarm_in_trouble),
    Fault("500", ("offline", "degraded")),
    Fault("hang", ("offline",), shows=alarm_in_trouble),
    Fault("slow", ("online", "degraded"), shows=slow_answers),
    Fault("silent_events", ("online",), shows=alarm_in_trouble),
    Fault("frozen_stream", ("degraded",)),
    Fault("corrupt_jpeg", ("online",), asked="snapshot/get", meanwhile=shows_no_half_picture, shows=bad_snapshots),
    Fault("nonce", ("online",), meanwhile=stays_usable, shows=ordered, logged=repeated),
    Fault("cut", ("offline",), shows=alarm_in_trouble),
    Fault("cut", ("offline",), {"refuses": True}, shows=alarm_in_trouble),
    Fault("reboot", ("offline",), shows=alarm_in_trouble, restarts=True),
    Fault("locked", ("locked",), back_s=40.0),
    Fault("rights", ("online",), shows=is_told_why, logged=refused_motion),
)


def fault(flat: SmallFlat, which: Fault, *, camera: str = "ip1") -> float:
    """Something goes wrong with the camera for a while; seconds until the status (and the rest) told of it.

    Afterwards everything is well again, without a restart.
    """
    door, service = flat.doors[camera], flat.pid(f"camera-{camera}")
    with flat.client(f"camera/{camera}/#", f"diagnostics/camera/{camera}") as bus:
        bus.payload(f"camera/{camera}/motion", lambda motion: motion.value != -1, 20.0)
        wait(bus, lambda: met(bus), 20.0, "the camera to have said who it is, and its alarm that it lives")
        began, since, before = time.monotonic(), time.time(), rebooted(bus)
        door.tell("fault", name=which.name, **which.settings)
        if which.also:
            door.tell(which.also)
        if which.asked:
            bus.say(f"camera/{camera}/{which.asked}", "now")

        def shown() -> bool:
            seen = state_of(bus, camera) in which.states and which.shows(bus)
            return seen and which.logged([one for one in door.log() if one["time"] > since])

        try:
            wait(bus, shown, NOTICED_S, str(which))
            seconds = time.monotonic() - began
            which.meanwhile(bus)
        finally:
            door.tell("fault", name=which.name, on=False)
        well(flat, bus, camera, which.back_s)
        bus.forget()
        wait(bus, lambda: good_snapshots(bus), which.back_s, "no complaint about snapshots")
        if which.restarts:
            wait(bus, lambda: rebooted(bus) != before, 5.0, "the diagnostics to tell of the restart")
        assert (rebooted(bus) != before) == which.restarts
    assert flat.pid(f"camera-{camera}") == service, "it was restarted"
    return seconds


def well(flat: SmallFlat, bus: Client, camera: str, limit_s: float) -> None:
    """The camera is online, its alarm listens, and an order is done; within the limit."""
    wait(bus, lambda: state_of(bus, camera) == "online", limit_s, "online again")
    wait(bus, lambda: not alarm_in_trouble(bus), limit_s, "the alarm to work again")
    answers: list[str] = []

    def done() -> bool:
        result = bus.order(camera, "Flip", "True")
        answers.append(f"{result.state} {result.error or ''}")
        return result.state == "done"

    peers.wait_until(done, f"an order to be done; {answers}", limit_s)
    bus.say(f"camera/{camera}/snapshot/get", "now")
    bus.until(lambda message: message.topic.endswith("/snapshot"), limit_s, "a picture")


def change_password(flat: SmallFlat, *, camera: str = "ip1") -> float:
    """Somebody changes the password, and later changes it back. Logins that failed until then, over all connections."""
    door = flat.doors[camera]
    with flat.client(f"camera/{camera}/#", f"diagnostics/camera/{camera}") as bus:
        bus.payload(f"camera/{camera}/motion", lambda motion: motion.value != -1, 20.0)
        wait(bus, lambda: met(bus), 20.0, "everybody to have logged in, the watchdog too")
        before = failed(door)
        door.tell("fault", name="password")
        door.tell("drop")  # the endless answers have to log in anew
        try:
            wait(bus, lambda: state_of(bus, camera) == "bad_login", NOTICED_S, "bad_login")
            bus.say(f"camera/{camera}/snapshot/get", "now")
            bus.say(f"camera/{camera}/order/Goto", "Kitchen")
            bus.collect(3.0)
            tried = failed(door) - before
        finally:
            door.tell("fault", name="password", on=False)
        well(flat, bus, camera, 40.0)
    return float(tried)


def failed(door: Door) -> int:
    """Logins with a wrong password that the camera has met."""
    return int(door.state()["door"]["wrong"])


def idle(flat: SmallFlat, *, camera: str = "ip1", seconds: float = 20.0) -> float:
    """Nobody wants anything: requests per second that the camera meets."""
    door = flat.doors[camera]
    began, before = time.monotonic(), [entry["time"] for entry in door.log()]
    with flat.client() as bus:
        bus.collect(seconds)
    after = [entry["time"] for entry in door.log()]
    return sum(one > before[-1] for one in after) / (time.monotonic() - began)


def wait(bus: Client, happened: Callable[[], bool], limit_s: float, what: str) -> None:
    """Listens until it happened."""

    def looked() -> bool:
        bus.pump()
        return happened()

    try:
        peers.wait_until(looked, what, limit_s)
    except TimeoutError as late:
        said = {message.topic: message.payload[:300] for message in bus.seen}
        raise AssertionError(f"{late}; it was {said}") from late


def state_of(bus: Client, camera: str) -> str:
    """The newest state that was heard of a camera."""
    said = newest(bus, f"camera/{camera}/status")
    return str(json.loads(said)["state"]) if said else ""

"""The camera's alarms: who listens, what is going on, and how it is written into an endless answer."""

from __future__ import annotations

import json
from collections.abc import Mapping
from queue import Empty, SimpleQueue
from threading import Lock

from services.simulators.camera.profiles import Profile

BOUNDARY = "myboundary"
START = (
    "HTTP/1.1 200 OK\r\nCache-Control: no-cache\r\nPragma: no-cache\r\nExpires: Thu, 01 Dec 2099 16:00:00 GMT\r\n"
    f"Connection: Keep-Alive\r\nContent-Type: multipart/x-mixed-replace; boundary={BOUNDARY}\r\n\r\n"
).encode()
CODES = (
    "VideoMotion", "VideoLoss", "VideoBlind", "AlarmLocal", "AudioMutation", "StorageNotExist", "StorageFailure",
    "StorageLowSpace", "TimeChange", "NTPAdjustTime", "RtspSessionDisconnect", "LensMaskOpen", "LensMaskClose",
)  # fmt: skip
Data = Mapping[str, object]
SMART_MOTION: Data = {"SmartMotionEnable": False}  # comes with every motion where events have data


def head(profile: Profile) -> bytes:
    """What comes before the first part."""
    return START * 2 if profile.event_header_twice else START


def part(profile: Profile, text: str) -> bytes:
    """One part of the endless answer."""
    space, blank = " " * profile.event_length_space, "\r\n" * profile.event_blank_lines
    length, before = len(text.encode()) + profile.event_length_off, "\r\n" * profile.event_line_before
    top = f"--{BOUNDARY}\r\nContent-Type: text/plain\r\nContent-Length:{space}{length}\r\n\r\n"
    return f"{top}{before}{text}\r\n\r\n{blank}".encode()


def written(profile: Profile, code: str, action: str, index: int, data: Data | None = None) -> str:
    """An event as firmware says it: form A with data over several lines, form B (of the 941's age) without."""
    text = f"Code={code};action={action};index={index}"
    data = SMART_MOTION if data is None and code == "VideoMotion" else data
    return text if not data or profile.event_form == "B" else f"{text};data={_styled(data)}\n"


def _styled(data: Data) -> str:
    """JSON as the firmware's library sets it."""
    lines = ",\n".join(f'   "{key}" : {_value(value)}' for key, value in data.items())
    return f"{{\n{lines}\n}}"


def _value(value: object) -> str:
    return f"[ {', '.join(map(json.dumps, value))} ]" if isinstance(value, list) else json.dumps(value)


def wanted(codes: str) -> frozenset[str]:
    """The codes of a request's `codes=[VideoMotion,AlarmLocal]`; `All` stands for every one."""
    return frozenset(code for code in codes.strip("[]").split(",") if code)


class Subscription:
    """One listener's queue."""

    def __init__(self, codes: frozenset[str]) -> None:
        self.codes = codes
        self._waiting: SimpleQueue[str] = SimpleQueue()

    def tell(self, code: str, text: str) -> None:
        """Hands an event on, if it was asked for."""
        if code in self.codes or "All" in self.codes:
            self._waiting.put(text)

    def wake(self) -> None:
        """Ends a wait at once (the listener's connection is to be closed)."""
        self._waiting.put("")

    def next(self, timeout_s: float) -> str | None:
        """The next event's text; None when none came in that time, empty when woken."""
        try:
            return self._waiting.get(timeout=timeout_s)
        except Empty:
            return None


class Events:
    """What is going on, and who wants to know. For several threads."""

    def __init__(self, profile: Profile) -> None:
        self._profile, self._lock = profile, Lock()
        self._listeners: list[Subscription] = []
        self._on: dict[str, set[int]] = {}

    def subscribe(self, codes: frozenset[str]) -> Subscription | None:
        """A new listener, which must be given back to `leave`; None when there are as many as the camera can take."""
        with self._lock:
            if len(self._listeners) >= self._profile.event_listeners:
                return None
            self._listeners.append(Subscription(codes))
            return self._listeners[-1]

    def leave(self, subscription: Subscription) -> None:
        """The listener has gone."""
        with self._lock:
            self._listeners.remove(subscription)

    @property
    def listeners(self) -> int:
        """How many listen."""
        return len(self._listeners)

    def tell(self, code: str, action: str, index: int = 0, data: Data | None = None) -> None:
        """Something begins (`Start`), ends (`Stop`) or happens (`Pulse`)."""
        with self._lock:
            active = self._on.setdefault(code, set())
            if action == "Start":
                active.add(index)
            elif action == "Stop":
                active.discard(index)
            for listener in self._listeners:
                listener.tell(code, written(self._profile, code, action, index, data))

    def forget(self) -> None:
        """Nothing goes on any longer, and nobody is told (a reboot)."""
        with self._lock:
            self._on.clear()

    def active(self, code: str) -> list[int]:
        """The channels on which this is going on."""
        with self._lock:
            return sorted(self._on.get(code, ()))

    def wake_all(self) -> None:
        """Ends every listener's wait."""
        with self._lock:
            for listener in self._listeners:
                listener.wake()

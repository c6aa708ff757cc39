"""What goes to the camera and comes back: requests read from a target, answers in a firmware's manner. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from urllib.parse import unquote

from services.simulators.camera.profiles import Profile

TEXT = "text/plain;charset=utf-8"


@dataclass(frozen=True)
class Request:
    """`cgi` is the program's name (`ptz`), `query` its arguments in order, decoded; `+` is not a space here."""

    target: str
    cgi: str
    query: tuple[tuple[str, str], ...]

    def text(self, key: str, default: str = "") -> str:
        """The first argument with this name."""
        return next((value for name, value in self.query if name == key), default)

    def number(self, key: str, default: float = 0.0) -> float:
        """The same as a number; ValueError when it is none."""
        return float(self.text(key) or default)

    @property
    def action(self) -> str:
        """What the program is to do."""
        return self.text("action")


def read(target: str) -> Request:
    """A request target, `/cgi-bin/ptz.cgi?action=start&code=Up`."""
    path, _, query = target.partition("?")
    cgi = path.removeprefix("/cgi-bin/").removesuffix(".cgi") if path.startswith("/cgi-bin/") else ""
    pairs = (pair.partition("=") for pair in query.split("&") if pair)
    return Request(target, cgi, tuple((unquote(key), unquote(value)) for key, _, value in pairs))


def spelt(profile: Profile, head: str) -> bytes:
    """A header block with the names spelt as this firmware does."""
    first, *fields = head.split("\r\n")
    if profile.header_case == "upper":
        fields = [name.upper() + colon + value for name, colon, value in (line.partition(":") for line in fields)]
    return "\r\n".join((first, *fields)).encode()


def refuses_brackets(profile: Profile, target: str) -> bool:
    """Whether this firmware does not read the brackets of a target as they are spelt."""
    wrong = {"raw": ("%5b", "%5d"), "encoded": ("[", "]"), "both": ()}[profile.brackets]
    return any(spelling in target.lower() for spelling in wrong)


@dataclass(frozen=True)
class Answer:
    """An answer with a body of known length."""

    body: bytes
    status: int = 200
    content_type: str = TEXT


OK = Answer(b"OK\r\n")


def lines(texts: Iterable[str]) -> Answer:
    """`key=value` lines, each ended by CRLF."""
    return Answer("".join(f"{text}\r\n" for text in texts).encode())


def refusal(profile: Profile) -> Answer:
    """How this firmware says no."""
    return {
        "400-body": Answer(b"Error\r\nBad Request!\r\n", 400),
        "200-error": Answer(b"Error\r\n"),
        "501": Answer(b"Error\r\nNot Implemented!\r\n", 501),
    }[profile.error_style]

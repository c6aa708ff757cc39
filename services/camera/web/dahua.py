"""Dahua's endless answers, which Amcrest gives too: the event stream and sound, both ways.

What the bytes mean is in `brands/dahua/` and `sound/`; who starts them, and again, in `alarm/` and `sound/desk.py`.
"""

from __future__ import annotations

import secrets
import threading
from collections.abc import Iterator

import httpx

from services.camera.address import Address
from services.camera.brands.dahua import events, replies, system
from services.camera.device import Away, Event, Refused
from services.camera.sound import g711
from services.camera.web.connection import connection, fetch, lost, respelt
from services.camera.web.digest import Login, header, read_challenge
from services.camera.web.endless import Endless
from services.camera.web.gate import Gate
from services.camera.web.upload import upload

BEATS = 3.25  # so many heartbeats of silence are the end: three were missed, and one may be late
PATIENT_S = 3600.0  # where there is no heartbeat: firmware that does not notice who has gone runs out of connections
SOUND_SILENCE_S = 6.0
RECEIVE = "/cgi-bin/audio.cgi?action=getAudio&httptype=singlepart&channel=1"  # 1-based whatever the motors want
SEND = "/cgi-bin/audio.cgi?action=postAudio&httptype=singlepart&channel=1"
CODECS = {"g.711a": g711.A_LAW, "g.711mu": g711.MU_LAW}


class DahuaEar:
    """An Ear (`alarm/listener.py`)."""

    def __init__(self, address: Address, gate: Gate, codes: tuple[str, ...], heartbeat_s: int) -> None:
        self.heartbeat_s = float(heartbeat_s)
        self._endless = Endless(address, gate, BEATS * heartbeat_s)
        self._target = events.attach(codes, heartbeat_s)

    def listen(self, *, patient: bool) -> Iterator[list[Event]]:
        """See `Ear`. After a refusal the next attempt spells its brackets the other way."""
        with self._endless.open(self._target, PATIENT_S if patient else None) as (response, pieces):
            try:
                _must_be_endless(response)
            except Refused:
                self._target = respelt(self._target)
                raise
            parser = events.Parser(events.boundary(response.headers.get("content-type", "")))
            yield []
            for piece in pieces:
                yield parser.feed(piece)

    def close(self) -> None:
        """See `Ear`."""
        self._endless.close()


class DahuaSound:
    """A Sound (`sound/desk.py`)."""

    def __init__(self, address: Address, gate: Gate) -> None:
        self._address, self._gate = address, gate

    def record(self, seconds: float, ended: threading.Event) -> g711.Samples:
        """See `Sound`."""
        endless = Endless(self._address, self._gate, SOUND_SILENCE_S)
        wanted, data = round(seconds * g711.RATE), bytearray()
        with endless.open(RECEIVE) as (response, pieces):
            _must_be_endless(response)
            codec = response.headers.get("content-type", "").partition(";")[0].strip().lower().removeprefix("audio/")
            if codec not in CODECS:
                raise Refused(f"the camera's sound is {codec[:40]!r}; set its audio to G.711A at 8000 Hz")
            for piece in pieces:
                data += piece
                if len(data) >= wanted or ended.is_set():
                    return g711.decode(bytes(data[:wanted]), CODECS[codec])
        raise Away(f"the camera ended its sound after {len(data) / g711.RATE:.1f} s")

    def play(self, data: bytes, ended: threading.Event) -> None:
        """See `Sound`. A login that is refused although it was right just before is tried once again, as elsewhere."""
        head = {"Content-Type": "Audio/G.711A", "Connection": "close"}
        for _ in range(2):
            signed = head | self._authorization()
            if upload(self._address, signed, SEND, data, g711.RATE, self._gate, ended):
                return
            self._gate.rest()
        raise Away("the camera answers 401 to the sound")

    def _authorization(self) -> dict[str, str]:
        """The header to send. A small request first shows that the login is right; another gets a nonce that is new."""
        user, password = self._address.user, self._address.password
        small = system.magic("getDeviceType")
        with connection(self._address, Login(user, password, self._gate)) as http:
            replies.check(fetch(http, small))
            challenges = _bare(http, small).headers.get_list("www-authenticate")
        if (challenge := read_challenge(challenges)) is None:
            return {}
        secret, cnonce = password.get_secret_value(), secrets.token_hex(8)
        return {"Authorization": header(challenge, user, secret, "POST", SEND, cnonce)}


def _must_be_endless(response: httpx.Response) -> None:
    """Raises what a short answer means."""
    if response.is_closed:
        replies.check(response)
        raise Away("the camera gave a short answer where an endless one was asked for")


def _bare(http: httpx.Client, target: str) -> httpx.Response:
    """The answer to a request without credentials."""
    try:
        return http.get(target, auth=None)
    except httpx.HTTPError as error:
        raise lost(error) from error

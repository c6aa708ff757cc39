"""Recording and playing over real HTTP: the right sound, the right length, the right pace, and what goes wrong."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from pydantic import SecretStr

from services.bus import Message
from services.camera.address import Address
from services.camera.commands import PlaySound
from services.camera.device import Away, BadLogin, Refused, Reply, Request, Status
from services.camera.errands import EndRecording, Play, Record, Recorded
from services.camera.plan import Run, Stage
from services.camera.sound import g711, wav
from services.camera.sound.desk import Desk
from services.camera.sound.takes import Takes
from services.camera.web.dahua import DahuaSound
from services.camera.web.gate import Gate
from tests.camera.speaking import PASSWORD, SpeakingCamera, speaking

WAIT_S = 10.0


class Quiet:
    """The device's Sender behind the desk."""

    def __init__(self) -> None:
        self.got: list[Request] = []
        self.closed = False

    def submit(self, request: Request, ticket: int) -> None:
        self.got.append(request)

    def close(self) -> None:
        self.closed = True


class Room:
    """A desk, the camera that it records from and plays on, and its inbox."""

    def __init__(self, camera: SpeakingCamera, password: str = PASSWORD) -> None:
        self.inbox: queue.Queue[Message] = queue.Queue()
        self.gate = Gate()
        address = Address(camera.url, "ros", SecretStr(password))
        self.behind = Quiet()
        self.desk = Desk(self.behind, DahuaSound(address, self.gate), self.inbox.put)

    def reply(self) -> Reply:
        value = self.inbox.get(timeout=WAIT_S).value
        assert isinstance(value, Reply)
        return value

    def ask(self, request: Request) -> Reply:
        self.desk.submit(request, 1)
        return self.reply()


@pytest.fixture
def camera() -> Iterator[SpeakingCamera]:
    with speaking() as running:
        yield running


@pytest.fixture
def room(camera: SpeakingCamera) -> Iterator[Room]:
    made = Room(camera)
    yield made
    made.desk.close()


def strongest(samples: wav.Sound, rate: int = g711.RATE) -> float:
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples))))
    return float(np.argmax(spectrum) * rate / len(samples))


def melody(seconds: float, rate: int) -> wav.Sound:
    """A tone that rises: it correlates with itself at one place only."""
    at = np.arange(int(seconds * rate)) / rate
    return 0.6 * np.sin(2 * np.pi * (300 * at + 400 * at**2))


@pytest.mark.parametrize("profile", ["ip3m-941w-2019", "ip2m-841b-strict", "2020s-dahua"])
@pytest.mark.parametrize("hz", [440.0, 1000.0])
def test_a_recording_has_the_tone_and_the_length(tmp_path: Path, profile: str, hz: float) -> None:
    with speaking(profile, hz) as camera:
        room = Room(camera)
        reply = room.ask(Record(1.5, tmp_path / "audio" / "one.wav"))
        room.desk.close()
    assert reply.result == Recorded(1.5, 44 + 2 * 12000)
    sound, rate = wav.read((tmp_path / "audio" / "one.wav").read_bytes())
    assert (rate, len(sound)) == (8000, 12000)
    assert abs(strongest(sound) - hz) < 1.0
    assert [file.name for file in (tmp_path / "audio").iterdir()] == ["one.wav"]


def test_mu_law_is_taken_and_other_codecs_are_refused_by_name(tmp_path: Path) -> None:
    with speaking(content_type="Audio/G.711Mu") as camera:
        room = Room(camera)
        assert room.ask(Record(0.1, tmp_path / "one.wav")).error is None
    with speaking(content_type="Audio/AAC") as camera:
        error = Room(camera).ask(Record(0.1, tmp_path / "two.wav")).error
    assert isinstance(error, Refused)
    assert "aac" in str(error)
    assert not (tmp_path / "two.wav").exists()


def test_a_microphone_that_breaks_off_gives_no_file(tmp_path: Path, camera: SpeakingCamera, room: Room) -> None:
    camera.lasts_s = 0.5
    reply = room.ask(Record(2.0, tmp_path / "one.wav"))
    assert isinstance(reply.error, Away)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("profile", ["ip3m-941w-2019", "ip2m-841b-strict", "2020s-dahua"])
@pytest.mark.parametrize("rate", [8000, 44100])
def test_what_is_played_arrives_whole_and_in_time(tmp_path: Path, profile: str, rate: int) -> None:
    (tmp_path / "one.wav").write_bytes(wav.write(wav.to_samples(melody(1.2, rate)), rate))
    with speaking(profile) as camera:
        room = Room(camera)
        reply = room.ask(Play(tmp_path / "one.wav"))
        room.desk.close()
    assert reply.error is None
    (heard,), (took_s,) = camera.heard, camera.took_s
    there = g711.decode(heard) / 32768
    assert np.corrcoef(there, melody(1.2, 8000)[: len(there)])[0, 1] > 0.999
    assert len(there) == 9600
    assert took_s > 0.7
    assert reply.received - reply.sent > 1.15
    assert camera.door.counters["wrong"] == 0


@pytest.mark.parametrize("after", [0, 800, 9600])  # at once, while it is sent, and when it is over
def test_an_odd_refusal_of_the_login_is_tried_again_once(
    tmp_path: Path, camera: SpeakingCamera, room: Room, after: int
) -> None:
    (tmp_path / "one.wav").write_bytes(wav.write(wav.to_samples(melody(1.2, 8000))))
    camera.odd = [after]
    assert room.ask(Play(tmp_path / "one.wav")).error is None
    assert [len(heard) for heard in camera.heard] == [9600]
    camera.odd = [after, after]
    error = room.ask(Play(tmp_path / "one.wav")).error
    assert isinstance(error, Away)
    assert "401" in str(error)
    assert len(camera.heard) == 1
    assert room.gate.book.ever == 3
    assert camera.door.counters["wrong"] == 0


def test_the_post_is_as_cameras_want_it(tmp_path: Path, camera: SpeakingCamera, room: Room) -> None:
    (tmp_path / "one.wav").write_bytes(wav.write(wav.to_samples(melody(0.1, 8000))))
    room.ask(Play(tmp_path / "one.wav"))
    assert camera.targets[-1] == "/cgi-bin/audio.cgi?action=postAudio&httptype=singlepart&channel=1"
    (head,) = camera.heads
    assert (head["Content-Type"], head["Content-Length"]) == ("Audio/G.711A", "9999999")
    assert "Transfer-Encoding" not in head


def test_a_loudspeaker_that_refuses_is_told_at_once(tmp_path: Path, camera: SpeakingCamera, room: Room) -> None:
    camera.refuses = True
    (tmp_path / "one.wav").write_bytes(wav.write(wav.to_samples(melody(5, 8000))))
    reply = room.ask(Play(tmp_path / "one.wav"))
    assert isinstance(reply.error, Refused)
    assert reply.received - reply.sent < 4


def test_a_file_that_is_no_wav_is_refused_before_anything_is_sent(
    tmp_path: Path, camera: SpeakingCamera, room: Room
) -> None:
    (tmp_path / "one.wav").write_bytes(b"ID3 an mp3")
    assert "no WAV" in str(room.ask(Play(tmp_path / "one.wav")).error)
    assert camera.targets == []


def test_one_at_a_time_each(tmp_path: Path, room: Room) -> None:
    (tmp_path / "one.wav").write_bytes(wav.write(wav.to_samples(melody(1.0, 8000))))
    room.desk.submit(Play(tmp_path / "one.wav"), 1)
    second = room.ask(Play(tmp_path / "one.wav"))
    assert "already" in str(second.error)
    assert room.ask(Record(0.1, tmp_path / "two.wav")).error is None
    assert room.reply().error is None


def test_a_recording_is_ended_early_and_what_there_is_is_kept(tmp_path: Path) -> None:
    waiting = threading.Event()

    class Endless:
        def record(self, seconds: float, ended: threading.Event) -> g711.Samples:
            waiting.set()
            assert ended.wait(WAIT_S)
            return np.zeros(4000, np.int16)

        def play(self, data: bytes, ended: threading.Event) -> None:
            raise AssertionError

    inbox: queue.Queue[Message] = queue.Queue()
    desk = Desk(Quiet(), Endless(), inbox.put)
    desk.submit(Record(60.0, tmp_path / "one.wav"), 1)
    assert waiting.wait(WAIT_S)
    desk.submit(EndRecording(), 2)
    replies = {reply.ticket: reply for reply in (inbox.get(timeout=WAIT_S).value for _ in range(2))}  # type: ignore[attr-defined]
    assert replies[1].result == Recorded(0.5, 8044)
    desk.close()


def test_the_end_of_the_service_ends_what_is_played(tmp_path: Path, room: Room) -> None:
    (tmp_path / "one.wav").write_bytes(wav.write(wav.to_samples(melody(60, 8000))))
    room.desk.submit(Play(tmp_path / "one.wav"), 1)
    room.desk.close()
    assert room.behind.closed
    assert not any(thread.name == "Play" for thread in threading.enumerate())


def test_everything_else_goes_to_the_device(room: Room) -> None:
    room.desk.submit(Status(), 1)
    assert room.behind.got == [Status()]


def test_a_wrong_password_counts_at_the_gate_that_all_share(tmp_path: Path, camera: SpeakingCamera) -> None:
    room = Room(camera, password="another")
    assert isinstance(room.ask(Record(1.0, tmp_path / "one.wav")).error, BadLogin)
    (tmp_path / "two.wav").write_bytes(wav.write(wav.to_samples(melody(0.1, 8000))))
    assert isinstance(room.ask(Play(tmp_path / "two.wav")).error, BadLogin)
    assert camera.door.counters["wrong"] == 2


def test_only_files_of_the_audio_folder_are_played(tmp_path: Path) -> None:
    folder = tmp_path / "audio"
    folder.mkdir()
    secret = tmp_path / "secret.wav"
    secret.write_bytes(b"RIFF")
    (folder / "link.wav").symlink_to(secret)
    takes = Takes("ip1", folder, lambda message: None)
    ended: list[Run] = []
    for name in ("link.wav", "none.wav"):
        plan = takes.play(PlaySound(name), 0.0)
        Stage(lambda request, ticket: None).begin(plan, 0.0, lambda run, now: ended.append(run))
    assert [type(run.error) for run in ended] == [Refused, Refused]
    for name in ("../secret.wav", "/etc/passwd", "..", ".hidden", "a\\b", ""):
        with pytest.raises(ValueError, match="audio folder"):
            PlaySound.read(name)

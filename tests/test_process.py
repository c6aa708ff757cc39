"""A service's process and its supervisor: the clock that is set back, and an end that a grandchild would hide."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from types import SimpleNamespace

import pytest

from services import peers, process
from services import supervisor as supervisor_module
from services.apartment.home import Home
from services.config import Apartment, BusSettings, Instance
from services.process import Clock
from services.registry import Row
from services.section import Section
from services.supervisor import Supervisor, in_background

HOLDS_THE_PIPE = """
import subprocess, sys
waits = subprocess.Popen([sys.executable, "-c", "import signal; signal.pause()"], start_new_session=True)
print('READY {"waits": %d}' % waits.pid, flush=True)
waits.wait()
"""

ENDS = """
import signal, sys, time
from pathlib import Path
own, other, takes = Path(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3])
def end(*_):
    time.sleep(takes)
    own.write_text("later" if other.exists() else "sooner")
    sys.exit()
signal.signal(signal.SIGTERM, end)
print("READY {}", flush=True)
signal.pause()
"""


SERVES = """
import os, signal, sys, threading
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from services import process
from services.apartment.home import Home
from services.config import Apartment, BusSettings, Instance
from services.registry import Row
from services.section import Section

@contextmanager
def start(config):
    for turn in turns:
        threading.Thread(target=turn, name="lane", daemon=True).start()
    yield SimpleNamespace(addresses={})
    print("in good order")

BODY
process.log_to_stderr()
instance = Instance("odd", Row("odd", "__main__", (), "it has a thread", on_bus=False), Section())
where = Apartment(Path("-"), BusSettings(), Home(items={}), Path("-"), (), instances={"odd": instance})
process.serve(where, ["odd"], ready)
"""
HAS_A_THREAD = SERVES.replace(
    "BODY",
    """
turns = [lambda: 1 / int(sys.argv[1]) and sys.exit()]
ready = lambda said: os.kill(os.getpid(), signal.SIGTERM) if int(sys.argv[1]) else None
""",
)
TELLS_WHAT_IT_WALKS = SERVES.replace(
    "BODY",
    """
import gc
turns = []

def ready(said):
    print(gc.get_freeze_count(), len(gc.get_objects()))
    os.kill(os.getpid(), signal.SIGTERM)
""",
)
IS_BUSY = SERVES.replace(
    "BODY",
    """
def deep(steps):
    return deep(steps - 1) if steps else sum(range(50))

def busy():
    while True:
        one = threading.Thread(target=deep, args=(20,))
        one.start()
        one.join()

turns = [busy] * 4
ready = lambda said: print("ready", flush=True)
""",
)


@pytest.mark.parametrize(
    ("walls", "told"),
    [
        pytest.param([100.0, 101.0, 102.0], [0, 0], id="it goes"),
        pytest.param([100.0, 101.0, 3702.0], [0, 0], id="it is set forward"),
        pytest.param([100.0, 101.0, -3498.0], [0, 3600], id="it is set back"),
        pytest.param([100.0, 3701.0, 102.0], [0, 3600], id="forward, and back again"),
        pytest.param([100.0, 101.0, 101.0], [0, 0], id="a second"),
    ],
)
def test_a_clock_that_is_set_back_is_noticed(walls: list[float], told: list[float]) -> None:
    wall, steady = iter(walls), iter([5.0, 6.0, 7.0])
    clock = Clock(lambda: next(wall), lambda: next(steady))
    assert [clock.set_back() for _ in told] == told


def test_a_service_is_started_again_though_a_process_of_its_own_holds_its_output_open() -> None:
    supervisor = Supervisor({"one": [sys.executable, "-c", HOLDS_THE_PIPE]})
    waiting: list[int] = []
    try:
        with in_background(supervisor) as ready:
            waiting.append(ready["one"]["waits"])
            child = supervisor.children["one"]
            assert child.process is not None
            os.kill(child.process.pid, signal.SIGKILL)
            killed = time.monotonic()
            peers.wait_until(lambda: child.restarts == 1 and child.ready is not None, "its next life")
            waiting.append(child.ready["waits"])  # type: ignore[index]
            assert time.monotonic() - killed < 20.0, "and the one that waits would wait for ever"
            os.kill(waiting[0], 0)
    finally:
        for pid in waiting:
            os.kill(pid, signal.SIGKILL)


def test_a_service_that_takes_long_to_fail_while_it_starts_waits_longer_each_time(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(supervisor_module, "SETTLED_S", 0.0)  # as long as any start
    supervisor = Supervisor({"one": [sys.executable, "-c", "raise SystemExit(2)"]})
    runs = Thread(target=supervisor.run, args=(lambda _: None,))
    runs.start()
    try:
        peers.wait_until(lambda: len(caplog.messages) >= 3, "three lives")
    finally:
        supervisor.stop()
        runs.join()
    told = [message.rpartition("again in ")[2] for message in caplog.messages[:3]]
    assert told == ["0.2 s", "0.4 s", "0.8 s"]


def test_a_state_folder_that_cannot_be_written_is_told_in_a_line(tmp_path: Path) -> None:
    config = tmp_path / "apartment.yaml"
    (tmp_path / "home.yaml").write_text("items: {Light: {type: Switch, label: Light}}\n")
    config.write_text(
        "home: home.yaml\nstate: home.yaml/state\nbus: {accounts: {persistence: invented}}\n"
        "persistence: {url: 'sqlite:///bus.db'}\n"
    )
    words = [sys.executable, "-m", "services", "serve", "persistence", "--config", str(config)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        f"{config}:1: state: expected a folder that can be written, "
        f"got {tmp_path}/home.yaml/state/persistence: Not a directory"
    ]


@contextmanager
def start(config: Section) -> Iterator[SimpleNamespace]:
    """A program that loses a connection while it runs."""
    yield SimpleNamespace(addresses={})
    raise ConnectionResetError(errno.ECONNRESET, "Connection reset by peer")


def test_the_story_of_an_error_in_a_service_that_runs_is_in_its_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    instance = Instance("odd", Row("odd", __name__, (), "it loses a connection", on_bus=False), Section())
    where = Apartment(Path("-"), BusSettings(), Home(items={}), tmp_path, (), instances={"odd": instance})
    stopping = Event()
    stopping.set()
    with pytest.raises(ConnectionResetError):
        process._one(where, instance, stopping, lambda name, addresses: None)
    assert "odd ends by a fault of its own\nTraceback" in caplog.text


def test_what_others_need_ends_after_them(tmp_path: Path) -> None:
    camera, service = tmp_path / "camera", tmp_path / "service"
    lines = {
        "simulated-camera": [sys.executable, "-c", ENDS, str(camera), str(service), "0"],
        "camera": [sys.executable, "-c", ENDS, str(service), str(camera), "0.5"],
    }
    with in_background(Supervisor(lines, last={"simulated-camera"})):
        pass
    assert (service.read_text(), camera.read_text()) == ("sooner", "later")


def test_a_thread_that_nobody_expects_to_end_ends_its_process_in_good_order_and_with_an_error() -> None:
    done = [
        subprocess.run([sys.executable, "-c", HAS_A_THREAD, divisor], capture_output=True, text=True, timeout=20)
        for divisor in ("0", "1")
    ]
    assert [one.returncode for one in done] == [1, 0]
    assert [one.stdout for one in done] == ["in good order\n", "in good order\n"]
    assert "the thread lane ends by a fault of its own\nTraceback" in done[0].stderr
    assert done[1].stderr == ""


def test_who_asks_again_and_again_where_a_service_hangs_does_not_end_it(tmp_path: Path) -> None:
    story = tmp_path / "story"
    command = [sys.executable, "-c", IS_BUSY]

    def told_times() -> int:
        return story.read_text().count("in serve")

    with story.open("w") as told, subprocess.Popen(command, stdout=subprocess.PIPE, stderr=told) as asked:
        assert asked.stdout is not None
        asked.stdout.readline()
        for _ in range(200):
            before = told_times()
            asked.send_signal(signal.SIGUSR1)
            peers.wait_until(lambda before=before: asked.poll() is not None or told_times() > before, "the stacks")
            assert asked.poll() is None
        asked.terminate()
        assert asked.wait(20) == 0


def test_what_a_service_was_started_with_is_not_walked_by_the_collector() -> None:
    done = subprocess.run([sys.executable, "-c", TELLS_WHAT_IT_WALKS], capture_output=True, text=True, timeout=20)
    frozen, walked = map(int, done.stdout.split()[:2])
    assert frozen > 20 * walked

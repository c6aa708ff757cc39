"""The services of this process, one mostly: bus, turns until a signal, log, READY line.

Not here: starting processes again, that is `supervisor.py`; what a turn is, that is `runner.py`.
"""

from __future__ import annotations

import ctypes
import faulthandler
import importlib
import json
import logging
import os
import secrets
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from services import document
from services.aside import Aside
from services.bus import WAKE_TOPIC, Message
from services.bus.connection import Address
from services.bus.mqtt import MqttBus
from services.config import Apartment, BusSettings, Instance
from services.errors import ConfigError, Unavailable, words
from services.memory import few_arenas, freeze
from services.runner import Runner
from services.steering import Steered
from services.topics import SERVICE_STATUS
from services.whole_file import write_private

log = logging.getLogger(__name__)

LONGEST_WAIT_S = 1.0
CLOCK_BACK_S = 2.0  # a clock that is set back further ends a service, to be started again
SIGNAL_S = 0.2  # a signal that comes while Python is about to wait is seen at the end of the wait only
SUPERVISED = "APARTMENT_SUPERVISED"  # set by the supervisor: end when it ends
Ready = Callable[[dict[str, Any]], None]
OneReady = Callable[[str, dict[str, Any]], None]


def log_to_stderr(level: int = logging.INFO) -> None:
    """The one log format: time, level, service or module, text."""
    logging.basicConfig(level=level, stream=sys.stderr, format=LOG_FORMAT, datefmt="%Y-%m-%dT%H:%M:%S", force=True)
    logging.getLogger("httpx").setLevel(logging.WARNING)  # one line per camera request otherwise


LOG_FORMAT = "%(asctime)s.%(msecs)03d %(levelname)-7s %(name)s: %(message)s"


def address(settings: BusSettings, client_id: str, account: str, **options: Any) -> Address:
    """Where the broker is, for a client that uses this account (anonymous without a password for it).

    ConfigError when a certificate cannot be used.
    """
    password = settings.accounts.get(account) or None  # an empty one is none
    return Address(
        client_id=client_id,
        host=settings.host,
        port=settings.port,
        user=account if password is not None else None,
        password=password.get_secret_value() if password is not None else None,
        tls=settings.tls.context() if settings.tls else None,
        keepalive_s=settings.keepalive_s,
        **options,
    )


def client_id(settings: BusSettings, name: str, state: Path) -> str:
    """Who a service is to the broker, in all its lives. Where it has an account, a name that nobody can guess:
    mosquitto gives a session, and all that waits in it, to whoever comes by its name, whatever account he has.
    """
    if not settings.accounts.get(name):
        return name
    file = state / name / "client"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        write_private(file, f"{name}-{secrets.token_hex(8)}")
    return file.read_text(encoding="ascii")


def serve(apartment: Apartment, names: Sequence[str], ready: Ready) -> None:
    """Runs services until SIGTERM or SIGINT, each in a thread of its own; a bug in one ends all and comes out as it is.

    So does one in any other thread: a camera whose thread for control is gone could not be stopped any more.
    `ready` is told once, when the last of them hears what it subscribed to.
    """
    if os.environ.get(SUPERVISED):
        _end_with_parent()
    few_arenas()
    signal.signal(signal.SIGUSR1, _tell_where)
    addresses: dict[str, Any] = {}

    def one_is_ready(name: str, own: dict[str, Any]) -> None:
        addresses[name] = own
        if len(addresses) == len(names):
            freeze()
            ready(addresses[name] if len(names) == 1 else {"services": addresses})

    stopping, asked, died = threading.Event(), deque[bool](), deque[Exception]()
    with stop_signals(lambda: asked.append(True)), _deaths(died.append), ThreadPoolExecutor(len(names)) as pool:
        instances = [apartment.instances[name] for name in names]
        futures = [pool.submit(_one, apartment, instance, stopping, one_is_ready) for instance in instances]
        while not asked and not died and not wait(futures, timeout=SIGNAL_S, return_when=FIRST_COMPLETED).done:
            pass
        why = next(iter(died), None)
        stopping.set()
        for future in futures:
            future.result()
        if why is not None:
            raise why


def _one(apartment: Apartment, instance: Instance, stopping: threading.Event, ready: OneReady) -> None:
    try:
        if instance.row.on_bus:
            _on_bus(apartment, instance, stopping, ready)
        else:
            _off_bus(instance, stopping, ready)
    except ConfigError as error:
        raise ConfigError(document.read(apartment.file).placed(error.faults)) from error
    except OSError as error:
        if not isinstance(error.filename, str) or not _belongs(Path(error.filename), apartment.state):
            log.exception("%s ends by a fault of its own", instance.name)
            raise
        why = words(error)
        raise ConfigError([f"{apartment.file}:1: state: expected a folder that can be written, got {why}"]) from error


def _belongs(file: Path, folder: Path) -> bool:
    """Whether it is in the folder, or a folder that this one would be made in."""
    file, folder = file.resolve(), folder.resolve()
    return file.is_relative_to(folder) or folder.is_relative_to(file)


@contextmanager
def _started(instance: Instance, *given: Any) -> Iterator[Any]:
    """What runs; Unavailable when this machine does not give it what it needs, a port that is free mostly."""
    with ExitStack() as stack:
        try:
            started = importlib.import_module(instance.row.module).start(instance.config, *given)
            running = stack.enter_context(started)
        except OSError as error:
            if error.filename is not None:
                raise
            raise Unavailable(f"{instance.name}: {words(error)}") from error
        yield running


def _off_bus(instance: Instance, stopping: threading.Event, ready: OneReady) -> None:
    """A program of its own, such as the simulated camera: it answers by itself."""
    with _started(instance) as program:
        ready(instance.name, dict(program.addresses))
        stopping.wait()


def _on_bus(apartment: Apartment, instance: Instance, stopping: threading.Event, ready: OneReady) -> None:
    row, name = instance.row, instance.name
    bus = MqttBus(
        address(
            apartment.bus,
            client_id(apartment.bus, name, apartment.state),
            name,
            protocol=row.protocol,
            durable=row.durable,
            inline=row.inline,
        ),
        birth=SERVICE_STATUS.message("online", service=name),
        will=SERVICE_STATUS.message("offline", service=name),
    )
    threading.Thread(target=_wake, args=(bus, stopping), daemon=True, name="stop").start()
    try:
        with _started(instance, bus.post) as service:
            runner = Runner(
                name, Steered(name, service, stopping.set), bus, time.time, Aside(apartment.state / name / "aside")
            )
            _turns(runner, stopping, Clock(), lambda: ready(name, dict(getattr(service, "addresses", {}))))
            runner.leave()
    finally:
        bus.close()


def _wake(bus: MqttBus, stopping: threading.Event) -> None:
    """A thread's body: a signal ends the wait for the next message."""
    stopping.wait()
    bus.post(Message(WAKE_TOPIC))


class Clock:
    """Notices that the wall clock is set back, as on a small machine that learns the time late.

    Whatever was due would be due only when that time comes again, a motor's stop too. So the service ends in good
    order, which stops what turns, and is started again with everything due at its time.
    """

    def __init__(self, wall: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic) -> None:
        self._wall, self._steady = wall, steady
        self._ahead = wall() - steady()

    def set_back(self) -> float:
        """By how many seconds; 0 where it is not worth ending for."""
        ahead = self._wall() - self._steady()
        back, self._ahead = self._ahead - ahead, max(self._ahead, ahead)
        return back if back > CLOCK_BACK_S else 0.0


def _turns(runner: Runner, stopping: threading.Event, clock: Clock, ready: Callable[[], None]) -> None:
    told = False
    while not stopping.is_set():
        if back := clock.set_back():
            log.warning("%s ends, to be started again: the clock was set back by %.0f s", runner.name, back)
            stopping.set()
        runner.turn(min(LONGEST_WAIT_S, max(0.0, runner.due - time.time())))
        if not told and runner.bus.listens:
            ready()
            told = True


@contextmanager
def stop_signals(stop: Callable[[], None]) -> Iterator[None]:
    """Calls `stop` at SIGTERM and SIGINT; after the latter the block ends with KeyboardInterrupt, once it is done.

    `stop` takes no lock: the next signal interrupts it (a dying parent sends one for each of its threads), and the
    lock of an Event would wait for itself.
    """
    interrupted = False

    def told(number: int, _frame: object) -> None:
        nonlocal interrupted
        interrupted = interrupted or number == signal.SIGINT
        stop()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, told)
    yield
    if interrupted:
        raise KeyboardInterrupt


def _tell_where(_number: int, _frame: object) -> None:
    """What every thread is doing, for whoever finds a service that hangs.

    Told by Python in this thread, which only waits: what `faulthandler.register` sets up reads the stacks while they
    change, and ends the process with that now and then (cpython issue 116008).
    """
    faulthandler.dump_traceback()


@contextmanager
def _deaths(tell: Callable[[Exception], None]) -> Iterator[None]:
    """Calls `tell` for every thread that ends by an error that nobody there expects; its story is in the log."""

    def hook(args: threading.ExceptHookArgs) -> None:
        if isinstance(args.exc_value, Exception):  # no SystemExit: by that a thread ends in good order
            name = args.thread.name if args.thread is not None else "that is gone"
            log.error("the thread %s ends by a fault of its own", name, exc_info=args.exc_value)
            tell(args.exc_value)

    before, threading.excepthook = threading.excepthook, hook
    try:
        yield
    finally:
        threading.excepthook = before


def exit_when_told() -> None:
    """SIGTERM, or a terminal that is closed (but for `nohup`), raises SystemExit: the command did not do its work."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: sys.exit(1))


def _end_with_parent() -> None:
    """Linux sends us SIGTERM when the supervisor dies, however it dies (prctl(2), PR_SET_PDEATHSIG)."""
    pr_set_pdeathsig = 1
    ctypes.CDLL(None, use_errno=True).prctl(pr_set_pdeathsig, signal.SIGTERM)
    if os.getppid() != int(os.environ[SUPERVISED]):
        os.kill(os.getpid(), signal.SIGTERM)  # it died before we asked


def ready_line(name: str, addresses: dict[str, Any]) -> str:
    """What a program prints once it answers: `READY {json}`."""
    return f"READY {json.dumps({'name': name, 'pid': os.getpid(), **addresses})}"

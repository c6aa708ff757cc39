"""The dashboard as it runs, in this process: a real broker, the runner's turns in a thread, HTTP on loopback."""

from __future__ import annotations

import os
import shutil
import ssl
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
from pydantic import SecretStr

from services import dashboard, peers
from services.aside import Aside
from services.bus.mqtt import MqttBus
from services.client import Client, connected
from services.config import BusSettings, load
from services.dashboard import passwords
from services.dashboard.settings import Config, User
from services.peers import mosquitto
from services.process import address
from services.runner import Runner
from services.simulated import CONFIG

PASSWORD = "a password for tests"
HASH = passwords.hashed(PASSWORD, cost=2)  # the tests log in often
USERS = {
    "ann": User(password=SecretStr(HASH), role="operator"),
    "vic": User(password=SecretStr(HASH), role="viewer"),
}


@dataclass
class Running:
    """A dashboard and its broker; `bus` is somebody else there who hears everything."""

    url: str
    folder: Path
    bus: Client
    settings: BusSettings
    ca: Path | None = None

    def browser(self, user: str | None = None) -> Browser:
        """Somebody with a cookie jar, logged in as that user."""
        browser = Browser(self.url, self.ca)
        if user is not None:
            browser.login(user)
        return browser


class Browser:
    """What a browser does for a page, without one."""

    def __init__(self, url: str, ca: Path | None = None) -> None:
        verify = ssl.create_default_context(cafile=str(ca)) if ca else True
        self.http = httpx.Client(base_url=url, timeout=30.0, trust_env=False, verify=verify)
        self.csrf = self.http.get("/api/session").json().get("csrf") or ""

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self.http.close()

    def login(self, user: str, password: str = PASSWORD) -> httpx.Response:
        """Logs in."""
        answer = self.http.post("/api/login", json={"user": user, "password": password})
        if answer.status_code == 200:
            self.csrf = answer.json()["csrf"]
        return answer

    def get(self, path: str, **more: Any) -> httpx.Response:
        """Looks."""
        return self.http.get(path, **more)

    def post(self, path: str, body: Any = None, **headers: str) -> httpx.Response:
        """Orders."""
        return self.http.post(path, json={} if body is None else body, headers={"X-CSRF-Token": self.csrf, **headers})


def configured(folder: Path, port: int, **changes: Any) -> Config:
    """The simulated apartment's dashboard on any free port."""
    if not (folder / "config").exists():
        shutil.copytree(CONFIG, folder / "config")
    environment = {"APARTMENT_BROKER_PORT": str(port), "APARTMENT_DASHBOARD_PORT": "0", "PATH": os.environ["PATH"]}
    config = load(folder / "config" / "simulated.yaml", environment=environment).instances["dashboard"].config
    assert isinstance(config, Config)
    return config.model_copy(update=changes)


@contextmanager
def running(folder: Path, ca: Path | None = None, **changes: Any) -> Iterator[Running]:
    """A broker and a dashboard with the account that it has in an installation; Missing without mosquitto."""
    with ExitStack() as stack:
        broker = stack.enter_context(mosquitto.private(folder / "mosquitto", anonymous=True))
        settings = BusSettings(port=broker.port, accounts={"dashboard": SecretStr(broker.passwords["dashboard"])})
        url = stack.enter_context(service(configured(folder, broker.port, **changes), settings, folder))
        bus = stack.enter_context(connected(BusSettings(port=broker.port), ["#"]))
        with Browser(url, ca) as browser:
            peers.wait_until(lambda: _online(browser), "the dashboard to hear the broker")
        yield Running(url, folder, bus, settings, ca)


def _online(browser: Browser) -> bool:
    """Nothing is said while the broker is away; the status is the dashboard's own."""
    answer = browser.get("/api/broker")
    return bool(answer.json().get("online"))


@contextmanager
def service(config: Config, settings: BusSettings, folder: Path) -> Iterator[str]:
    """The service with its turns in a thread; yields its address."""
    bus, stop, broken = MqttBus(address(settings, "dashboard", "dashboard")), threading.Event(), []
    try:
        with dashboard.start(config, bus.post) as made:
            runner = Runner("dashboard", made, bus, time.time, Aside(folder / "aside"))

            def turns() -> None:
                try:
                    while not stop.is_set():
                        runner.turn(min(0.2, max(0.0, runner.due - time.time())))
                except BaseException as error:
                    broken.append(error)
                    raise

            thread = threading.Thread(target=turns, name="dashboard's turns")
            thread.start()
            try:
                yield str(made.addresses["url"]).rstrip("/")
            finally:
                stop.set()
                thread.join()
    finally:
        bus.close()
    assert broken == []

"""OpenHAB with its MQTT binding, for the generated rules: Node runs them, this plays the binding on a real broker.

The binding does what its things file says: it listens to the state topics of the broker's channels, and hands a
message on as `topic#payload`. It knows nothing of the rules.
"""

from __future__ import annotations

import json
import os
import queue
import shutil
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from services.openhab.check.findings import Findings
from services.openhab.check.things import read
from services.openhab.versions import parse
from services.peers import Missing, wait_until

SHIM = Path(__file__).parent / "shim"
LIMIT_S = 60.0


class StandIn:
    """The process of the rules and the connection of the binding."""

    def __init__(self, process: subprocess.Popen[str], port: int, things: str, separator: str) -> None:
        self.process, self.separator = process, separator
        self.said: list[dict[str, Any]] = []
        self.online = threading.Event()
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._fences = 0
        self.bridge = next(one for one in read(things, parse("5"), Findings("things")) if one.is_bridge)
        self._channels = {
            f"{self.bridge.uid}:{one.id}": str(one.settings["stateTopic"]) for one in self.bridge.channels
        }
        self._client = paho.Client(CallbackAPIVersion.VERSION2, client_id="openhab-stand-in")
        self._client.reconnect_delay_set(min_delay=1, max_delay=1)
        self._client.on_connect = self._connected
        self._client.on_disconnect = self._lost
        for uid, topic in self._channels.items():
            self._client.message_callback_add(topic, lambda _c, _u, message, uid=uid: self._heard(uid, message))
        threading.Thread(target=self._listen, daemon=True).start()
        self.tell(kind="fence", number=0)
        self._wait_fence(0)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()

    def tell(self, **line: Any) -> None:
        """Something happens in OpenHAB."""
        assert self.process.stdin is not None
        with self._lock:
            self.process.stdin.write(json.dumps(line) + "\n")
            self.process.stdin.flush()

    def settle(self) -> None:
        """Waits until the rules have done what follows from everything told so far."""
        self._fences += 1
        self.tell(kind="fence", number=self._fences)
        self._wait_fence(self._fences)

    def _wait_fence(self, number: int) -> None:
        wait_until(lambda: {"fence": number} in self.said, f"fence {number}", LIMIT_S)

    def lines(self, key: str) -> list[dict[str, Any]]:
        """What was said of one sort: rule, publish, command, update or warn."""
        return [line for line in list(self.said) if key in line]

    def close(self) -> None:
        """Ends both."""
        self._client.disconnect()
        self._client.loop_stop()
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait(LIMIT_S)

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for text in self.process.stdout:
            line = json.loads(text)
            if "publish" in line:
                self._client.publish(line["publish"], line["value"], qos=1, retain=line["retained"])
            self.said.append(line)

    def _connected(self, client: paho.Client, *_: object) -> None:
        for topic in self._channels.values():
            client.subscribe(topic, qos=1)
        self.tell(kind="thing", thing=self.bridge.uid, status="ONLINE")
        self.online.set()

    def _lost(self, *_: object) -> None:
        self.online.clear()
        if self.process.poll() is None and self.process.stdin is not None and not self.process.stdin.closed:
            self.tell(kind="thing", thing=self.bridge.uid, status="OFFLINE")

    def _heard(self, uid: str, message: paho.MQTTMessage) -> None:
        event = f"{message.topic}{self.separator}{message.payload.decode()}"
        self.tell(kind="channel", channel=uid, event=event)


@contextmanager
def running(
    script: Path, things: str, port: int, items: dict[str, dict[str, Any]], separator: str
) -> Iterator[StandIn]:
    """Runs a script of rules with these items until the end of the block; Missing where Node is not installed."""
    node = shutil.which("node") or shutil.which("nodejs")
    if node is None:
        raise Missing("node is not installed: apt-get install nodejs")
    process = subprocess.Popen(
        [node, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "NODE_PATH": str(SHIM)},
    )  # fmt: skip
    try:
        assert process.stdin is not None
        process.stdin.write(json.dumps({"kind": "items", "items": items}) + "\n")
        stand_in = StandIn(process, port, things, separator)
        try:
            yield stand_in
        finally:
            stand_in.close()
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                stream.close()

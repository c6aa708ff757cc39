"""The programs of the dashboard's benchmark, each a process of its own: who says much, and who looks at it.

`python -m tests.dashboard.flood say PORT ITEMS RATE` and `... look PORT VIEWERS`; each goes on until it is ended.
"""

from __future__ import annotations

import asyncio
import sys
import threading
import time

import paho.mqtt.client as paho

HERE = "127.0.0.1"
STEP_S = 0.02


def say(port: int, items: int, rate: int) -> None:
    """New states for all items in turn, so many a second."""
    client = paho.Client(paho.CallbackAPIVersion.VERSION2, client_id="flood")
    client.connect(HERE, port)
    client.loop_start()
    number, began = 0, time.monotonic()
    while True:
        due = int((time.monotonic() - began) * rate)
        for one in range(number, due):
            client.publish(f"home/Item_{one % items}/state", f"{one % 997 / 10:.1f} °C", qos=0, retain=True)
        number = max(number, due)
        threading.Event().wait(STEP_S)


async def look(port: int, viewers: int) -> None:
    """Pages that read all that they are sent and do nothing with it."""

    async def one() -> None:
        reader, writer = await asyncio.open_connection(HERE, port)
        writer.write(f"GET /api/live?topics=home/%2B/state HTTP/1.1\r\nHost: {HERE}:{port}\r\n\r\n".encode())
        while await reader.read(1 << 16):
            pass

    async with asyncio.TaskGroup() as group:
        for _ in range(viewers):
            group.create_task(one())


if __name__ == "__main__":
    if sys.argv[1] == "say":
        say(*map(int, sys.argv[2:]))
    else:
        asyncio.run(look(*map(int, sys.argv[2:])))

"""The bridge as a program of its own, for tests with a real ROS master: rospy's node exists once per process.

Bus messages come as JSON lines on standard input, what the service publishes goes out as JSON lines. Arguments:
the configuration as JSON. It ends with the end of its input, and logs to `bridge.log` (or $BRIDGE_LOG) in ROS_HOME.
"""

from __future__ import annotations

import json
import logging
import os
import queue
import sys
import threading
import time

from services.bridge import Config, start
from services.bridge.service import Bridge, GivenUp
from services.bus import Message
from services.errors import BadMessage

Inbox = queue.SimpleQueue[Message | None]


def main() -> None:
    config = Config.model_validate_json(sys.argv[1])
    log = os.path.join(os.environ["ROS_HOME"], os.environ.get("BRIDGE_LOG", "bridge.log"))
    logging.basicConfig(filename=log, level=logging.INFO, format="%(levelname)s %(filename)s %(message)s")
    inbox: Inbox = queue.SimpleQueue()
    threading.Thread(target=listen, args=(inbox,), daemon=True).start()
    try:
        turns(config, inbox)
    except GivenUp as error:
        logging.error("%s", error)
        sys.exit(1)


def turns(config: Config, inbox: Inbox) -> None:
    with start(config, inbox.put) as service:
        while True:
            try:
                message = inbox.get(timeout=0.05)
            except queue.Empty:
                say(service, None)
                continue
            if message is None:
                return
            say(service, message)


def listen(inbox: Inbox) -> None:
    for line in sys.stdin:
        said = json.loads(line)
        inbox.put(Message(said["topic"], said["payload"].encode(), received=time.time()))
    inbox.put(None)


def say(service: Bridge, message: Message | None) -> None:
    now = time.time()
    try:
        published = list(service.handle(message, now)) if message else []
    except BadMessage as error:
        published = []
        logging.warning("dropped: %s", error)
    for out in (*published, *service.tick(now)):
        sys.stdout.write(json.dumps({"topic": out.topic, "payload": out.payload.decode()}) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()

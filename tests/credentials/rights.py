"""What each account may do by the table of topics, worked out from the table alone and not by the code that writes
the broker's access list; one example topic (several, where it matters whose it is) for every row; and what OpenHAB and
the plain MQTT devices of the example home may beside the table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import yaml

from services.registry import REGISTRY
from services.topics import TABLE, Topic

CAMERAS = ("ip1", "ip2")
EXAMPLES = {
    "item": ("Lab_Lamp",), "cam": CAMERAS, "robot": ("tiago",), "key": ("Goto",), "marker": ("582",), "id": ("a1",),
    "platform": ("sensor",), "entity": ("motion",), "device": ("home",), "node": ("lab-lamp",), "property": ("state",),
    "attribute": ("$name",), "trait": ("$name", "$unit"), "component": ("camera/ip1/motors",),
}  # fmt: skip
HOME = yaml.safe_load((Path(__file__).parents[2] / "config" / "home.yaml").read_text(encoding="utf-8"))
SAID = {one["mqtt"]["state"] for one in HOME["items"].values() if "mqtt" in one} | {
    one["mqtt"]["availability"] for one in HOME["things"].values() if "mqtt" in one
}
HEARD = {one["mqtt"]["command"] for one in HOME["items"].values() if "command" in one.get("mqtt", {})}
STRANGE = (
    "foo", "home", "home/Lab_Lamp", "home/Lab_Lamp/state/more", "home//state/x", "camera/ip1", "camera/ip1/order",
    "service/all/status/x", "diagnostic", "Home/Lab_Lamp/state", "/home/Lab_Lamp/state", "$SYS/broker/uptime",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One topic, its row, and what its levels say."""

    topic: str
    row: Topic
    levels: dict[str, str]


def cases(accounts: list[str]) -> Iterator[Case]:
    """Every row of the table with every camera and every service."""
    for row in TABLE:
        choices = [accounts if name == "service" else EXAMPLES[name] for name in row.names]
        for chosen in product(*choices):
            levels = dict(zip(row.names, chosen, strict=True))
            yield Case(row.name(**levels), row, levels)


def roles(account: str) -> set[str]:
    """The words of the table that mean this account."""
    plays = {row.name: row.plays for row in REGISTRY}
    found = {account, plays.get(account, "")}
    return found | {"camera-<cam>"} if account.startswith("camera-") else found


def may(account: str, who: tuple[str, ...], case: Case) -> bool:
    """Whether that list of roles means this account, for this topic: a camera's service for its own camera only."""
    if "<service>" in who:
        return case.levels["service"] == account
    meant = roles(account) & set(who)
    if meant == {"camera-<cam>"} and "cam" in case.levels:
        return account == f"camera-{case.levels['cam']}"
    return bool(meant)


def of_devices(account: str, *, write: bool) -> set[str]:
    """Which topics of the plain devices an account may write or read: OpenHAB steers them, they say how they are."""
    return {("openhab", True): HEARD, ("openhab", False): SAID, ("devices", True): SAID, ("devices", False): HEARD}.get(
        (account, write), set()
    )

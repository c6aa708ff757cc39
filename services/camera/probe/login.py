"""How the firmware checks logins: kinds, spelling of the challenge, life of a nonce. Never with a wrong password."""

from __future__ import annotations

import re
from typing import Any

from services.camera.device import Refused
from services.camera.probe.findings import Findings
from services.camera.probe.wire import ODD_S, Exchange, Wire
from services.camera.web.digest import Challenge, read_challenge, says_stale

TARGET = "/cgi-bin/magicBox.cgi?action=getDeviceType"
USES = 16  # of nonces that were used before: a flaky firmware refuses about every other one
IN_VAIN = 6  # refused without a single one that passed: it takes each once
ODD_ONES = 3  # so many of USES may be refused for other reasons
PAIR = re.compile(r'(\w+)\s*=\s*(?:"([^"]*)"|([^,\s]+))')
STANDARD = ("www-authenticate", "connection", "content-length", "content-type", "date", "server")


class Foreign(Refused):
    """The camera does not speak Dahua's HTTP API."""


def first(wire: Wire, found: Findings) -> None:
    """The challenge as it comes, then the one login that decides whether the password is right."""
    challenge = wire.bare(TARGET, "challenge")
    if challenge.status == 404:
        raise Foreign("this camera has no Dahua or Amcrest HTTP API (/cgi-bin is not there)")
    found.switches |= read_challenge_form(challenge)
    wire.ask(TARGET, "device type")


def read_challenge_form(answer: Exchange) -> dict[str, Any]:
    """Kinds of login that are offered, and how the header is spelled. Pure."""
    kinds = {one.partition(" ")[0].lower() for one in answer.challenges}
    auth = "digest+basic" if {"basic", "digest"} <= kinds else next(iter(sorted(kinds)), "none")
    form: dict[str, Any] = {"auth": auth}
    digests = [one for one in answer.challenges if one.lower().startswith("digest")]
    for first in digests[:1]:
        values = {key.lower(): quoted or bare for key, quoted, bare in PAIR.findall(first)}
        form["challenge_spacing"] = "spaced" if re.search(r'",\s+\w+=', first) else "compact"
        form["qop"] = values.get("qop", "")
        form["realm"] = read_realm(values.get("realm", ""))
    if digests:
        algorithms = (re.search(r'algorithm="?([\w-]+)', one) for one in digests)
        form["digest_algorithms"] = tuple(found[1] if found else "MD5" for found in algorithms)
    names = [key for key, _ in answer.headers if key.lower() in STANDARD]
    form["header_case"] = "upper" if names and all(name.isupper() for name in names) else "mixed"
    return form


def read_realm(realm: str) -> str:
    """What the realm ends with: 32 hexadecimal digits, the MAC address, or else the serial number. Pure."""
    if re.search(r" [0-9a-fA-F]{32}$", realm):
        return "hex"
    return "mac" if re.match(r"DH_[0-9A-F]{12}$", realm) else "serial"


def nonces(wire: Wire, found: Findings) -> None:
    """Whether a nonce is taken again: uses one until it is refused, then its successor. A good login follows each."""
    if found.switches["auth"] == "basic":
        found.unknown["nonce"] = "it takes Basic only, which has no nonces"
        return
    passed = refused = 0
    stale = False
    challenge = _fresh(wire)
    while passed + refused < USES and (passed or refused < IN_VAIN):
        if challenge.count == 0:
            wire.proven = wire.signed(TARGET, challenge).status == 200 or wire.proven
        elif (answer := wire.signed(TARGET, challenge)).status == 200:
            passed += 1
        else:
            refused += 1
            stale = stale or says_stale(answer.challenges)
            wire.pause(ODD_S if passed else 0.0)
            challenge = _fresh(wire)
    found.switches["nonce"] = "single-use" if not passed else "flaky" if refused > ODD_ONES else "reusable"
    wire.reuses, wire.challenge = found.switches["nonce"] == "reusable", None
    if not wire.reuses:
        found.switches["stale"] = stale


def _fresh(wire: Wire) -> Challenge:
    challenge = read_challenge(wire.bare(TARGET).challenges)
    assert challenge is not None
    return challenge

"""The database, the cameras and ROS, as far as the configuration uses them."""

from __future__ import annotations

import http.client
import os
import socket
import xmlrpc.client
from collections.abc import Iterator, Mapping
from typing import Any
from urllib.parse import urlsplit

from services import history
from services.camera.device import BadLogin, Locked
from services.camera.probe import login
from services.camera.probe.wire import Wire
from services.doctor.findings import Finding, ill, well
from services.errors import ConfigError, DeviceError, Unavailable
from services.storage import Address, upkeep

ANSWER_S = 4.0
LOOPBACK = ("127.", "::1")


def database(at: Address) -> Iterator[Finding]:
    """Whether it can be used, and is set up so that nothing is lost."""
    try:
        for good, what in upkeep.look(at):
            yield Finding("database", good, what, "" if good else "docs/database.md; then apartment db check")
    except ConfigError as error:
        mend = "apartment db init; the password is DATABASE_PASSWORD (apartment secrets)"
        if "this program knows" in str(error):
            mend = "install the newer program again, or go back with its `apartment db upgrade --to`"
        yield ill("database", str(error), mend)
    except Unavailable as error:
        yield ill("database", f"{at}: {error}", "systemctl start mariadb; or `url` in the section persistence")


def readers(config: history.Config) -> Iterator[Finding]:
    """Whether the history service, who comes under other names than the writer, may do there what it has to."""
    wanted = [(config.address, upkeep.ASKS), *([(config.keeping_address, upkeep.KEEPS)] if config.keep else [])]
    for at, statements in wanted if config.address.dialect == "mysql" else ():
        try:
            upkeep.tried(at, statements)
        except (ConfigError, Unavailable) as error:
            yield ill("database", f"{at.user} cannot do the work of history: {error}", "apartment db init")
        else:
            yield well("database", f"{at.user} may do the work of history")


def camera(name: str, config: Any) -> Iterator[Finding]:
    """Whether it answers and takes the login: one try, so that a wrong password does not lock the account."""
    part = f"camera {name}"
    wire = Wire(config.url, config.user, config.password, config.address.certificate)
    try:
        _log_in(wire, config.brand)
    except Locked as error:
        yield ill(part, str(error), "wait for half an hour, or switch it off and on; then check the password")
    except BadLogin as error:
        yield ill(part, str(error), f"apartment secrets set CAMERA_{name.upper()}_PASSWORD; see docs/camera-account.md")
    except DeviceError as error:
        yield ill(part, f"{config.url}: {error}", "its power and network; `url` in its section; apartment probe")
    else:
        yield well(part, f"{config.url} answers" + (f" and takes the login of {config.user}" if wire.proven else ""))


def _log_in(wire: Wire, brand: str) -> None:
    """Where it is no camera of this kind, only whether anybody is there: the login of ONVIF is of another form."""
    try:
        if brand == "amcrest":
            wire.ask(login.TARGET)
        else:
            wire.bare("/")
    finally:
        wire.close()


def ros(
    environment: Mapping[str, str] = os.environ, master_uri: str | None = None, unit: str = "apartment-bridge.service"
) -> Iterator[Finding]:
    """Whether the master answers, and names can be resolved in both directions; ROS nodes call each other by name.

    As the bridge sees it: `environment` is what it is started with, `master_uri` its setting, `unit` its unit.
    """
    uri = master_uri or environment.get("ROS_MASTER_URI", "http://localhost:11311")
    try:
        nodes = _nodes(uri)
    except (OSError, http.client.HTTPException, xmlrpc.client.Error) as error:
        mend = "start roscore; or bridge.master_uri: http://<robot>:11311 (without it its own ROS_MASTER_URI)"
        yield ill("ros", f"no master at {uri}: {error}", mend)
        return
    yield well("ros", f"a master at {uri}")
    yield _own_name(environment, urlsplit(uri).hostname or "localhost", unit)
    for host in sorted({urlsplit(node).hostname or "" for node in nodes}):
        if _resolved(host) is None:
            yield ill("ros", f"a node calls itself {host}, which nobody here knows", f"a line for {host} in /etc/hosts")


class _Transport(xmlrpc.client.Transport):
    """With a limit: a robot that is switched off answers never."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """See `xmlrpc.client.Transport`."""
        made = super().make_connection(host)
        made.timeout = ANSWER_S
        return made


def _nodes(uri: str) -> list[str]:
    """The addresses of all nodes that the master knows."""
    with xmlrpc.client.ServerProxy(uri, transport=_Transport()) as proxy:
        master: Any = proxy
        _, _, state = master.getSystemState("/apartment_doctor")
        names = {str(name) for kind in state for _, owners in kind for name in owners}
        answers = [master.lookupNode("/apartment_doctor", name) for name in sorted(names)]
    return [str(answer[2]) for answer in answers if answer[0] == 1]


def _own_name(environment: Mapping[str, str], master: str, unit: str) -> Finding:
    address = "ROS_IP=<this machine's address>"
    ours = f"systemctl edit {unit}: [Service] Environment={address} (outside of systemd: export {address})"
    name = environment.get("ROS_HOSTNAME") or environment.get("ROS_IP") or socket.gethostname()
    found, there = _resolved(name), _resolved(master)
    if found is None:
        mend = f"{ours}, or a line in /etc/hosts here and on the robot"
        return ill("ros", f"this machine calls itself {name}, which cannot be resolved", mend)
    if found.startswith(LOOPBACK) and there is not None and not there.startswith(LOOPBACK):
        told = f"this machine calls itself {name}, which is {found}: the robot would look for it in itself"
        return ill("ros", told, ours)
    return well("ros", f"this machine calls itself {name} ({found})")


def _resolved(host: str) -> str | None:
    try:
        return str(socket.getaddrinfo(host, None)[0][4][0])
    except (OSError, UnicodeError):
        return None

"""systemd's units, users and folders as texts: one unit for each process, with no more than it needs.

Not here: where they are put, `steps.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from services.installation.layout import BROKER, DATABASE, GROUP, STATE, SYSTEM, TARGET, Part

# The most memory (MB) that a service may take before it is ended and started again; twice what it was seen to need.
MEMORY = {"camera": 1200, "simulated-camera": 800, "bridge": 500, "dashboard": 300}
OTHERS = 250
BROKER_MB = 400  # its full queue (mosquitto.conf) takes two thirds; ended for more, it would read the same back
HARDENED = """\
NoNewPrivileges=yes
CapabilityBoundingSet=
AmbientCapabilities=
ProtectSystem=strict
ProtectHome=yes
ProtectProc=invisible
ProtectClock=yes
ProtectHostname=yes
ProtectControlGroups=yes
ProtectKernelLogs=yes
ProtectKernelModules=yes
ProtectKernelTunables=yes
PrivateDevices=yes
PrivateTmp=yes
DevicePolicy=closed
LockPersonality=yes
RemoveIPC=yes
RestrictNamespaces=yes
RestrictRealtime=yes
RestrictSUIDSGID=yes
SystemCallArchitectures=native
SystemCallFilter=@system-service
SystemCallFilter=~@privileged @obsolete
SystemCallErrorNumber=EPERM
"""
FAMILIES = "AF_INET AF_INET6 AF_UNIX"
ROS_FAMILIES = f"{FAMILIES} AF_NETLINK"  # it asks the kernel for the machine's own addresses


def service(part: Part, python: Path, config: Path, secrets: Path) -> str:
    """The unit of one process."""
    names = [one.name for one in part.services]
    credentials = "".join(f"LoadCredential={name}:{secrets / 'credentials' / name}\n" for name in part.secrets)
    families = ROS_FAMILIES if "bridge" in names else FAMILIES
    return f"""\
# Written by `apartment install`; your own changes belong into {part.unit}.d/.
[Unit]
Description=Smart apartment: {", ".join(names)}
After=network-online.target mosquitto.service mariadb.service
Wants=network-online.target
PartOf={TARGET}
StartLimitIntervalSec=0

[Service]
Type=exec
User={part.user}
Group={GROUP}
UMask=0007
ExecStart={python} -m services serve {" ".join(names)} --config {config}
{credentials}Restart=always
RestartSec=2
TimeoutStopSec=20
MemoryMax={memory(part)}M
TasksMax=200
ReadWritePaths={" ".join([str(STATE), *(f"-{path}" for path in written(part))])}
{HARDENED}RestrictAddressFamilies={families}

[Install]
WantedBy={TARGET}
"""


def memory(part: Part) -> int:
    """The most that a process may take, MB."""
    return sum(MEMORY.get(one.row.name.removesuffix("-<cam>"), OTHERS) for one in part.services)


def written(part: Part) -> Iterator[Path]:
    """The folders beside the configuration that a camera's service writes itself: places, lens, recordings."""
    for one in part.services:
        if one.row.section[0] == "cameras":
            named = (one.config.model_dump().get(name) for name in ("places", "audio", "camera_info"))
            folders = (path.parent if path.suffix else path for path in named if isinstance(path, Path))
            yield from dict.fromkeys(SYSTEM / path for path in folders if str(path) != ".")


def target(parts: Iterable[Part]) -> str:
    """What starts and stops all of them together."""
    return f"""\
[Unit]
Description=Smart apartment
Wants={" ".join(part.unit for part in parts)}

[Install]
WantedBy=multi-user.target
"""


def renewal(python: Path, secrets: Path) -> dict[str, str]:
    """Certificates are renewed long before they end; who has a new one is told, and nobody else is disturbed."""
    reload = "systemctl --no-block reload-or-restart mosquitto.service"
    restart = "systemctl --no-block try-restart apartment-dashboard.service"
    return {
        "apartment-renew.service": f"""\
[Unit]
Description=Smart apartment: certificates that end soon

[Service]
Type=oneshot
ExecStart={python} -m services secrets renew --within 60 --out {secrets}
ExecStart={_handed(secrets / "broker", BROKER / "server", "-o mosquitto -m 0600", reload)}
ExecStart=-{_handed(secrets / "database", DATABASE / "server", "-o mysql -m 0600", 'mariadb -e "FLUSH SSL"')}
ExecStart={_handed(secrets / "dashboard", SYSTEM / "dashboard", f"-g {GROUP} -m 0640", restart)}
UMask=0077
ReadWritePaths={secrets} {SYSTEM}
CapabilityBoundingSet=CAP_CHOWN CAP_FOWNER CAP_DAC_OVERRIDE
{"".join(line for line in HARDENED.splitlines(keepends=True) if "Capabilit" not in line and "~" not in line)}\
RestrictAddressFamilies=AF_UNIX
IPAddressDeny=any
""",
        "apartment-renew.timer": """\
[Unit]
Description=Smart apartment: certificates that end soon

[Timer]
OnCalendar=weekly
RandomizedDelaySec=1h
Persistent=yes

[Install]
WantedBy=timers.target
""",
    }


def _handed(made: Path, used: Path, whose: str, then: str) -> str:
    """A line that gives a new key and certificate to who uses them, and tells him; one that he has is left alone."""
    key = f"install {whose} {made}/server.key {used}.key"
    crt = f"install {whose.replace('0640', '0644')} {made}/server.crt {used}.crt"
    return f"/bin/sh -c 'cmp -s {made}/server.crt {used}.crt || {{ {key} && {crt} && {{ {then} || true; }}; }}'"


def broker() -> str:
    """What the system's mosquitto is started with instead of its own file."""
    return f"""\
[Unit]
StartLimitIntervalSec=0

[Service]
ExecStart=
ExecStart=/usr/sbin/mosquitto -c {BROKER / "mosquitto.conf"}
ExecReload=
ExecReload=/bin/kill -HUP $MAINPID
Restart=always
RestartSec=2
MemoryMax={BROKER_MB}M
"""


def database() -> str:
    """MariaDB's own file: encrypted for other machines, and a commit is on the disk before it is answered."""
    return f"""\
# Written by `apartment install`. For other machines: bind-address = 0.0.0.0, and `apartment db grant NAME --host ...`.
[mariadb]
ssl_cert = {DATABASE / "server.crt"}
ssl_key = {DATABASE / "server.key"}
innodb_flush_log_at_trx_commit = 1
character_set_server = utf8mb4
"""


def users(parts: Iterable[Part]) -> str:
    """sysusers.d: a user for each process, one group for what they share."""
    lines = [f"g {GROUP} -"]
    for part in parts:
        lines += [f'u {part.user} -:{GROUP} "Smart apartment" {STATE}']
    return "\n".join(lines) + "\n"


def folders(parts: Iterable[Part]) -> str:
    """tmpfiles.d: what the services share, where a new file belongs to the group; and what each has for itself.

    The latter is for the user of its process, who is another one where services come to share a process or leave it.
    """
    parts = list(parts)
    lines = [f"d {STATE} 2770 root {GROUP} -", f"z {STATE}/* ~2770 - {GROUP} -"]  # a database of SQLite is there too
    lines += [f"Z {STATE}/{one.name} - {part.user} {GROUP} -" for part in parts for one in part.services]
    for place in dict.fromkeys(path for part in parts for path in written(part)):
        lines += [f"d {place} 2770 root {GROUP} -", f"Z {place} ~2770 root {GROUP} -"]
    return "\n".join(lines) + "\n"

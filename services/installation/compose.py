"""The same services as containers: a compose file as plain values, with the same limits as systemd's units.

Not here: the image itself, `Containerfile`. All share the machine's network, as ROS and cameras need it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from services.installation.layout import BROKER, STATE, SYSTEM, Part
from services.installation.units import BROKER_MB, memory, written

FOLDER = "${APARTMENT:-/etc/apartment}"  # on the machine; what `apartment install` writes
LOGS = {"driver": "local", "options": {"max-size": "10m", "max-file": "5"}}


def compose(parts: Iterable[Part], config: str) -> dict[str, Any]:
    """Broker, database and every process."""
    parts = list(parts)
    named = dict.fromkeys(name for part in parts for name in part.secrets)
    return {
        "name": "apartment",
        "services": {
            "broker": _broker(),
            "database": _database(),
            **{part.name: _service(part, config) for part in parts},
        },
        "volumes": {"state": {}, "broker": {}, "database": {}},
        "secrets": {
            name: {"file": f"{FOLDER}/secrets/credentials/{name}"} for name in [*named, "DATABASE_ROOT_PASSWORD"]
        },
    }


def _hard(**more: Any) -> dict[str, Any]:
    return {
        "network_mode": "host",
        "restart": "unless-stopped",
        "read_only": True,
        "security_opt": ["no-new-privileges:true"],
        "tmpfs": ["/tmp"],
        "logging": LOGS,
        **more,
    }


def _service(part: Part, config: str) -> dict[str, Any]:
    names = [one.name for one in part.services]
    volumes = [f"{FOLDER}:{SYSTEM}:ro", f"state:{STATE}"]
    volumes += [f"{FOLDER}/{path.relative_to(SYSTEM)}:{path}" for path in written(part)]
    return _hard(
        image="apartment",
        build=".",
        command=["serve", *names, "--config", f"{SYSTEM}/{config}"],
        cap_drop=["ALL"],
        environment={"CREDENTIALS_DIRECTORY": "/run/secrets"},
        secrets=list(part.secrets),
        volumes=volumes,
        mem_limit=f"{memory(part)}m",
        pids_limit=200,
        depends_on=["broker"],
    )


def _broker() -> dict[str, Any]:
    return _hard(
        image="eclipse-mosquitto:2.0",
        command=["mosquitto", "-c", f"{BROKER}/mosquitto.conf"],
        volumes=[f"{FOLDER}/broker:{BROKER}:ro", "broker:/var/lib/mosquitto"],
        mem_limit=f"{BROKER_MB}m",
    )


def _database() -> dict[str, Any]:
    return _hard(
        image="mariadb:10.11",
        command=["--bind-address=127.0.0.1", "--innodb-flush-log-at-trx-commit=1", "--character-set-server=utf8mb4"],
        environment={"MARIADB_ROOT_PASSWORD_FILE": "/run/secrets/DATABASE_ROOT_PASSWORD"},
        secrets=["DATABASE_ROOT_PASSWORD"],
        volumes=["database:/var/lib/mysql"],
        tmpfs=["/tmp", "/run/mysqld"],
        mem_limit="600m",
    )

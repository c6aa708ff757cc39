"""Runs Home Assistant without its pages in this process, on a broker of ours, and tries what it found. For its Python.

Not a test by itself: `home_assistant.py` starts it. It prints JSON: every state, and what each service call led to.
"""

from __future__ import annotations

import asyncio
import json
import sys
import uuid
from pathlib import Path
from typing import Any

from homeassistant import bootstrap, runner
from homeassistant.helpers import entity_registry

CONFIGURATION = "homeassistant:\n  name: Trial\n  unit_system: metric\n  time_zone: UTC\nlogger:\n  default: error\n"
LIMIT_S = 60.0
POLL_S = 0.25


def entry(port: int) -> dict[str, Any]:
    """The MQTT integration as its own dialogue would store it."""
    fixed = {"version": 1, "minor_version": 1, "domain": "mqtt", "title": "bus", "options": {}, "source": "user"}
    kept = {"pref_disable_new_entities": False, "pref_disable_polling": False, "unique_id": None, "disabled_by": None}
    data = {"broker": "127.0.0.1", "port": port, "discovery": True}
    return {**fixed, **kept, "entry_id": uuid.uuid4().hex, "data": data}


def prepare(folder: Path, port: int) -> None:
    """A fresh configuration."""
    (folder / ".storage").mkdir(parents=True)
    (folder / "configuration.yaml").write_text(CONFIGURATION)
    stored = {"version": 1, "minor_version": 1, "key": "core.config_entries", "data": {"entries": [entry(port)]}}
    (folder / ".storage" / "core.config_entries").write_text(json.dumps(stored))


async def until(ready: Any) -> bool:
    """Whether it became ready in time."""
    for _ in range(int(LIMIT_S / POLL_S)):
        if ready():
            return True
        await asyncio.sleep(POLL_S)
    return False


async def trial(folder: Path, wanted: dict[str, Any]) -> dict[str, Any]:
    """Starts, waits for the entities, calls the services, stops."""
    hass = await bootstrap.async_setup_hass(runner.RuntimeConfig(config_dir=str(folder), skip_pip=True))
    assert hass is not None
    await hass.async_start()

    def entities() -> dict[str, str]:
        registry = entity_registry.async_get(hass)
        return {one.unique_id: one.entity_id for one in registry.entities.values()}

    await until(lambda: set(wanted["entities"]) <= set(entities()))
    found = entities()
    calls = {}
    for unique_id, domain, service, data, state in wanted["calls"]:
        entity = found[unique_id]
        await until(lambda entity=entity: hass.states.get(entity).state != "unavailable")  # else it is passed over
        await hass.services.async_call(domain, service, {"entity_id": entity, **data}, blocking=True)
        await until(lambda entity=entity, state=state: hass.states.get(entity).state == state)
        calls[unique_id] = hass.states.get(entity).state
    states = {
        unique_id: hass.states.get(entity).state for unique_id, entity in found.items() if hass.states.get(entity)
    }
    await hass.async_stop()
    return {"states": states, "calls": calls}


if __name__ == "__main__":
    at, where = int(sys.argv[1]), Path(sys.argv[2])
    prepare(where, at)
    sys.stdout.write("TRIAL " + json.dumps(asyncio.run(trial(where, json.loads(sys.argv[3])))) + "\n")

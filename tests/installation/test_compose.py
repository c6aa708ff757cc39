"""The compose file: as the official schema wants it, and as hard as the units. No container is run here."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

ROOT = Path(__file__).parents[2]
OFFICIAL = json.loads((ROOT / "tests/fixtures/compose/compose-spec.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def compose(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the command writes."""
    file = tmp_path_factory.mktemp("compose") / "compose.yaml"
    command = [sys.executable, "-m", "services", "install", "--compose", str(file)]
    subprocess.run(command, check=True, timeout=120, cwd=ROOT)
    assert file.read_bytes() == (ROOT / "compose.yaml").read_bytes(), "apartment install --compose compose.yaml"
    read: dict[str, Any] = yaml.safe_load(file.read_text(encoding="utf-8"))
    return read


def test_the_official_schema_accepts_it_and_no_other_words(compose: dict[str, Any]) -> None:
    jsonschema.validate(compose, OFFICIAL)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**compose, "servces": {}}, OFFICIAL)
    compose["services"]["broker"]["restrt"] = "no"
    try:
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(compose, OFFICIAL)
    finally:
        del compose["services"]["broker"]["restrt"]


def test_it_has_the_same_services_as_the_units_each_with_its_own_secrets(compose: dict[str, Any]) -> None:
    services = compose["services"]
    assert {"broker", "database", "camera-ip1", "persistence", "history", "bridge", "dashboard"} == set(services)
    assert services["camera-ip1"]["secrets"] == ["BUS_CAMERA_IP1_PASSWORD", "CAMERA_IP1_PASSWORD"]
    for one in services.values():
        assert one["read_only"] is True
        assert one["security_opt"] == ["no-new-privileges:true"]
        assert set(one.get("secrets", ())) <= set(compose["secrets"])
        assert "privileged" not in one

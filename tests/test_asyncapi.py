"""The table of topics as AsyncAPI, against the official schema, and its payloads' schemas against the payloads."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from services import payloads
from services.topic import Kind
from services.topics import TABLE, asyncapi

ROOT = Path(__file__).parents[1]
OFFICIAL = ROOT / "tests/fixtures/asyncapi/3.0.0.json"


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    """What the command prints."""
    command = [sys.executable, "-m", "services", "topics", "--asyncapi"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=ROOT, check=True)
    printed: dict[str, Any] = json.loads(done.stdout)
    return printed


def validator() -> jsonschema.Draft7Validator:
    return jsonschema.Draft7Validator(json.loads(OFFICIAL.read_text(encoding="utf-8")))


def test_the_official_schema_accepts_the_document(document: dict[str, Any]) -> None:
    faults = [f"{'/'.join(map(str, one.path))}: {one.message[:200]}" for one in validator().iter_errors(document)]
    assert faults == []


@pytest.mark.parametrize(
    "spoil",
    [
        lambda one: one.pop("info"),
        lambda one: one["channels"]["history_get"].update(adress="x"),
        lambda one: one["operations"]["send_history_get"].update(action="shout"),
        lambda one: one["operations"]["send_history_get"]["bindings"]["mqtt"].update(qos=3),
    ],
)
def test_the_official_schema_refuses_a_spoilt_one(spoil: Any) -> None:
    spoilt = asyncapi.document()
    spoil(spoilt)
    assert list(validator().iter_errors(spoilt))


def test_every_row_is_a_channel_with_its_flags(document: dict[str, Any]) -> None:
    assert len(document["channels"]) == len(TABLE)
    addresses = {one["address"].replace("{", "<").replace("}", ">"): name for name, one in document["channels"].items()}
    assert set(addresses) == {row.pattern for row in TABLE}
    for row in TABLE:
        sent = document["operations"][f"send_{addresses[row.pattern]}"]
        assert sent["bindings"]["mqtt"]["retain"] == (row.kind is Kind.STATE)
        assert [tag["name"] for tag in sent["tags"]] == list(row.writers)


def test_every_reference_leads_somewhere(document: dict[str, Any]) -> None:
    found = []

    def walk(value: Any) -> None:
        if isinstance(value, dict):
            if isinstance(value.get("$ref"), str):
                found.append(value["$ref"])
            value = list(value.values())
        for inner in value if isinstance(value, list) else ():
            walk(inner)

    walk(document)
    assert found
    for reference in found:
        place = document
        for key in reference.removeprefix("#/").split("/"):
            place = place[key]


def test_what_a_service_says_fits_its_schema(document: dict[str, Any]) -> None:
    said = payloads.Position(pan=1.0, tilt=2.0, zoom=0.0, moving=False, place=None)
    schema = {"$ref": "#/components/schemas/Position", "components": document["components"]}
    jsonschema.validate(json.loads(said.model_dump_json()), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"pan": "left"}, schema)

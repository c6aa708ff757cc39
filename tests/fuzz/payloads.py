"""Payloads that nobody should send, drawn from a seed: nearly right ones, made from a model's schema, and rubbish."""

from __future__ import annotations

import json
import random
from typing import Any

from pydantic import BaseModel

from services.topic import Topic

NUMBERS: tuple[Any, ...] = (
    0,
    -1,
    1,
    2**31,
    -(2**31) - 1,
    2**53 + 1,
    2**63,
    2**64,
    10**30,
    -0.0,
    0.1,
    1e300,
    1e308,
    -1e308,
    5e-324,
    180,
    359.999,
    1e15,
)
TEXTS = (
    "",
    " ",
    "\0",
    "a\0b",
    "\ud800",
    "\udfff\ud800",
    "\u202e",
    "\ufeff",
    "x" * 70,
    "x" * 5000,
    "é" * 200,
    "../../etc/passwd",
    "%s%n",
    "${jndi:x}",
    "'; DROP TABLE item; --",
    "<script>alert(1)</script>",
    "NaN",
    "-Infinity",
    "UNDEF",
    "NULL",
    "ON",
    "OFF",
    "21.5 °C",
    "1e999",
    "2026-01-31T07:05:00Z",
    "9999-12-31T23:59:59.999999Z",
    "0001-01-01T00:00:00",
    "\n",
    "\r\n",
    "#",
    "+",
    "home/+/state",
    "\U0001f600",
)
RAW = (
    b"",
    b"\0",
    b"\xff\xfe",
    b"\xc3\x28",
    b"\xed\xa0\x80",
    b"{",
    b"[]",
    b"null",
    b"true",
    b'""',
    b"{}",
    b"NaN",
    b"-",
    b"1e999",
    b"\xef\xbb\xbf{}",
    b'{"a":1,"a":2}',
    b"[" * 5000,
    b'{"a":' * 3000 + b"1" + b"}" * 3000,
    b"9" * 5000,
    b"\xff\xd8\xff\xe0",
)
LARGE = (60_000, 262_144, 262_145, 400_000)
DEPTH = 3


def drawn(rng: random.Random, row: Topic) -> bytes:
    """A payload for this topic."""
    kind = rng.random()
    if kind < 0.10:
        return rng.choice(RAW)
    if kind < 0.20:
        return rng.randbytes(rng.choice([1, 2, 7, 40, 300, 5000]))
    if kind < 0.205:
        return bytes([rng.choice(b'x[{"9\0')]) * rng.choice(LARGE)
    if kind < 0.30 or not (isinstance(row.payload, type) and issubclass(row.payload, BaseModel)):
        return _encoded(rng, rng.choice([rng.choice(TEXTS), rng.choice(NUMBERS), value(rng)]))
    return _encoded(rng, _nearly(rng, row.payload.model_json_schema()))


def value(rng: random.Random, depth: int = 0) -> Any:
    """Anything that JSON can say."""
    kind = rng.randrange(7 if depth < DEPTH else 4)
    if kind == 0:
        return rng.choice(NUMBERS)
    if kind in (1, 2):
        return rng.choice(TEXTS)
    if kind == 3:
        return rng.choice([None, True, False])
    if kind == 4:
        return [value(rng, depth + 1) for _ in range(rng.choice([0, 1, 3]))]
    if kind == 5:
        return [value(rng, DEPTH)] * rng.choice([1, 100, 3000])
    return {rng.choice(TEXTS): value(rng, depth + 1) for _ in range(rng.choice([0, 1, 3]))}


def _encoded(rng: random.Random, what: Any) -> bytes:
    """As JSON, or a text as it is; surrogates as JSON escapes or as the bytes that UTF-8 forbids."""
    if isinstance(what, str) and rng.random() < 0.7:
        return what.encode(errors="surrogatepass")
    text = json.dumps(what, ensure_ascii=rng.random() < 0.5)
    data = text.encode(errors="surrogatepass")
    return data[: rng.randrange(len(data) + 1)] if rng.random() < 0.05 else data


def _nearly(rng: random.Random, schema: dict[str, Any]) -> Any:
    made = fitting(rng, schema, schema)
    if isinstance(made, dict):
        for name in list(made):
            chance = rng.random()
            if chance < 0.12:
                made[name] = value(rng)
            elif chance < 0.16:
                del made[name]
        if rng.random() < 0.05:
            made[rng.choice(TEXTS)] = value(rng)
    return made


def fitting(rng: random.Random, schema: dict[str, Any], root: dict[str, Any], depth: int = 0) -> Any:
    """A value of that schema, at the borders of what it allows or a little beyond."""
    if "$ref" in schema:
        return fitting(rng, root["$defs"][schema["$ref"].rpartition("/")[2]], root, depth + 1)
    for choice in ("anyOf", "oneOf", "allOf"):
        if choice in schema:
            return fitting(rng, rng.choice(schema[choice]), root, depth + 1)
    if "enum" in schema or "const" in schema:
        return rng.choice(schema.get("enum") or [schema["const"]])
    kind = schema.get("type")
    if kind == "object" and "properties" in schema:
        wanted = [name for name in schema["properties"] if name in schema.get("required", ()) or rng.random() < 0.6]
        return {name: fitting(rng, schema["properties"][name], root, depth + 1) for name in wanted}
    if kind == "object":
        inner = schema.get("additionalProperties")
        inner = inner if isinstance(inner, dict) else {}
        return {rng.choice(TEXTS): fitting(rng, inner, root, depth + 1) for _ in range(rng.choice([0, 1, 40]))}
    if kind == "array":
        items = schema.get("prefixItems") or [schema.get("items", {})] * rng.choice(
            [0, 1, 3, 200 if depth < DEPTH else 1]
        )
        return [fitting(rng, one, root, depth + 1) for one in items]
    if kind in ("integer", "number"):
        near = [schema[key] for key in ("minimum", "maximum") if key in schema]
        return rng.choice([*near, *(one + 1 for one in near), rng.randrange(1000), rng.choice(NUMBERS)])
    if kind == "string":
        return rng.choice(["a", "tiago", "582", "2026-01-31T07:05:00.123Z", rng.choice(TEXTS)])
    return {"boolean": rng.random() < 0.5, "null": None}.get(str(kind), value(rng, DEPTH))

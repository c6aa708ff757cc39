"""Asks a running OpenHAB (5.1 and later) what it thinks of files: its own parser, which loads nothing.

Its answer to a file with faults is one text with a line for each. Not here: our own check (`check/`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import PurePath

import httpx

from services.errors import Unavailable
from services.openhab.check.findings import Finding

PATH = "/rest/file-format/parse"
KINDS = {  # what it reads, and from which release on; it answers 415 before
    ".items": "text/vnd.openhab.dsl.item",
    ".things": "text/vnd.openhab.dsl.thing",
    ".sitemap": "text/vnd.openhab.dsl.sitemap",
    ".rules": "application/vnd.openhab.dsl.rule",
}
NOT_KNOWN = (httpx.codes.NOT_FOUND, httpx.codes.UNSUPPORTED_MEDIA_TYPE, httpx.codes.NOT_ACCEPTABLE)
_PLACE = re.compile(r"\[(\d+),(\d+)\]|[Ll]ine (\d+)")
TIMEOUT_S = 30.0


def check(files: Mapping[str, str], url: str, token: str | None) -> list[Finding]:
    """Its faults, by file; Unavailable when it does not answer or does not let us."""
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    found = []
    try:
        with httpx.Client(base_url=url, headers=headers, timeout=TIMEOUT_S, trust_env=False) as http:
            for name, text in files.items():
                kind = KINDS.get(PurePath(name).suffix)
                if kind is not None:
                    found += _faults(name, http.post(PATH, content=text.encode(), headers={"Content-Type": kind}))
    except httpx.HTTPError as error:
        raise Unavailable(f"{url}: no answer: {type(error).__name__} {error}".strip()) from error
    return sorted(found)


def _faults(name: str, answer: httpx.Response) -> list[Finding]:
    if answer.is_success or answer.status_code in NOT_KNOWN:
        return []
    if answer.status_code != httpx.codes.BAD_REQUEST:
        raise Unavailable(
            f"{answer.request.url.host}: expected 200 or 400, got {answer.status_code}: is a token needed?"
        )
    lines = [line.strip() for line in answer.text.splitlines() if line.strip()] or ["OpenHAB refuses the file"]
    return [_finding(name, line) for line in lines]


def _finding(name: str, text: str) -> Finding:
    match = _PLACE.search(text)
    line = int(match[1] or match[3]) if match else 1
    return Finding(name, line, int(match[2]) if match and match[2] else 1, f"OpenHAB: {text}")

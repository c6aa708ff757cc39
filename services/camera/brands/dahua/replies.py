"""What every answer has in common: lines of `key=value`, OK, and the ways to say no. Pure."""

from __future__ import annotations

import httpx

from services.camera.device import Away, Locked, Refused


def read_table(body: str) -> dict[str, str]:
    """`key=value` lines, split at the first `=`."""
    pairs = (line.partition("=") for line in body.splitlines())
    return {key.strip(): value.strip() for key, found, value in pairs if found}


def is_ok(body: str) -> bool:
    """Success is a body whose first word is exactly OK."""
    return body.split()[:1] == ["OK"]


def check(response: httpx.Response) -> httpx.Response:
    """The answer when it is a good one; else the error that says what to do about it."""
    text = response.text[:200] if response.headers.get("content-type", "text/").startswith("text/") else ""
    if "User Locked" in text:
        raise Locked("the camera has locked this account after wrong passwords")
    if response.status_code == 401:
        if "Invalid Authority" in text:
            raise Refused("the account has no right to do that")
        raise Away("the camera answered 401 without a reason to doubt the password")  # its connections may be used up
    if response.status_code >= 500 and response.status_code != 501:
        raise Away(f"the camera answered {response.status_code}", answered=True)
    if response.status_code != 200 or text.split()[:1] == ["Error"]:
        raise Refused(f"the camera answered {response.status_code} {' '.join(text.split())[:80]}".strip())
    return response

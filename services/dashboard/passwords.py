"""Passwords of people, hashed with scrypt (RFC 7914) of the standard library: made, recognised and checked.

A hash reads `scrypt$n$r$p$salt$key`, salt and key in base64. Not here: who may do what (`http/guard.py`).
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import re
import secrets

COST, BLOCK, LANES = 2**15, 8, 1  # 32 MiB and about 0.1 s each: OWASP's password storage cheat sheet allows it
FORM = re.compile(r"scrypt\$(\d{1,7})\$(\d{1,2})\$(\d{1,2})\$([A-Za-z0-9+/=]{16,})\$([A-Za-z0-9+/=]{40,})")
MOST_MEMORY = 256 * 1024 * 1024
NOBODY = "scrypt$32768$8$1$" + base64.b64encode(bytes(16)).decode() + "$" + base64.b64encode(bytes(32)).decode()


def hashed(password: str, *, cost: int = COST) -> str:
    """The hash of a password, with a salt of its own."""
    salt = secrets.token_bytes(16)
    key = _key(password, salt, cost, BLOCK, LANES)
    return f"scrypt${cost}${BLOCK}${LANES}${base64.b64encode(salt).decode()}${base64.b64encode(key).decode()}"


def is_hash(text: str) -> bool:
    """Whether `hashed` could have made this, and it can be checked here."""
    found = FORM.fullmatch(text)
    if found is None:
        return False
    cost, block, lanes = (int(found[part]) for part in (1, 2, 3))
    return cost > 1 and cost & (cost - 1) == 0 and 0 < 128 * cost * block * lanes <= MOST_MEMORY


def matches(password: str, text: str) -> bool:
    """Whether a password has that hash; takes the same time for `NOBODY`, whom no password fits."""
    found = FORM.fullmatch(text)
    assert found is not None
    cost, block, lanes = (int(found[part]) for part in (1, 2, 3))
    key = _key(password, base64.b64decode(found[4]), cost, block, lanes)
    return hmac.compare_digest(key, base64.b64decode(found[5])) and text != NOBODY


def _key(password: str, salt: bytes, cost: int, block: int, lanes: int) -> bytes:
    return hashlib.scrypt(password.encode(), salt=salt, n=cost, r=block, p=lanes, maxmem=MOST_MEMORY + 2**20, dklen=32)

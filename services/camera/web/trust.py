"""Which certificate a camera at an https:// address has to show; what it means that it shows another one.

Made once for all connections: reading the system's authorities takes 30 ms on a Raspberry Pi.
"""

from __future__ import annotations

import ssl
from functools import cache
from pathlib import Path

from services.camera.device import Away
from services.tls import peer_context

MEND = "name the right one as `certificate` beside its address, see docs/camera-account.md"


def trust(url: str, certificate: Path | None) -> ssl.SSLContext:
    """For connections to that address: the file alone, the system's authorities without one; at http:// nobody.

    ConfigError when the file cannot be used.
    """
    return _nobody() if url.startswith("http://") else _authorities() if certificate is None else _alone(certificate)


def away(error: Exception, text: str) -> Away:
    """No connection, or none any more, as our error: `text`, unless it is for the camera's certificate."""
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, ssl.SSLCertVerificationError):
        cause = cause.__cause__ or cause.__context__  # httpcore hides the cause
    return Away(text if cause is None else f"its certificate is not trusted: {cause.verify_message}; {MEND}")


@cache
def _nobody() -> ssl.SSLContext:
    """What a client has to be given that never speaks TLS: nothing is loaded for it."""
    return ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)


@cache
def _authorities() -> ssl.SSLContext:
    return ssl.create_default_context()


@cache
def _alone(certificate: Path) -> ssl.SSLContext:
    return peer_context(("certificate",), certificate)

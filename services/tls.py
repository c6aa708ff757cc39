"""TLS by the files that a configuration names; what is wrong with one of them is a fault of its setting.

Not here: making certificates (`credentials/certificates.py`).
"""

from __future__ import annotations

import ssl
from pathlib import Path

from services.errors import ConfigError, Setting, SettingError

Keys = tuple[str, ...]  # of the section that names the files, from the configuration's top


def client_context(section: Keys, ca: Path, cert: Path | None = None, key: Path | None = None) -> ssl.SSLContext:
    """Checks the other end by that authority, host name included, TLS 1.2 or newer; shows `cert` where there is one.

    ConfigError when a file cannot be used.
    """
    _must_be_readable(section, ca=ca, cert=cert, key=key)
    try:
        made = ssl.create_default_context(cafile=ca)
    except ssl.SSLError as error:
        raise SettingError((*section, "ca"), f"expected certificates as PEM, got none in {ca}") from error
    if cert is not None:
        _show(made, section, cert, key)
    return made


def peer_context(setting: Keys, certificate: Path) -> ssl.SSLContext:
    """Trusts who shows this very certificate, or one that it has signed, and nobody else; TLS 1.2 or newer.

    ConfigError when the file cannot be used.
    """
    *section, name = setting
    _must_be_readable(tuple(section), **{name: certificate})
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # with no authority yet, and it requires a certificate
    # What a device signs for itself names no host that fits. Having the key of this one certificate is the proof.
    made.check_hostname = False
    made.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN  # it may be signed by an authority that we do not know
    try:
        made.load_verify_locations(cafile=certificate)
    except ssl.SSLError as error:
        raise SettingError(setting, f"expected a certificate as PEM, got none in {certificate}") from error
    return made


def server_context(section: Keys, cert: Path, key: Path) -> ssl.SSLContext:
    """Shows that certificate to whoever comes; ConfigError when a file cannot be used."""
    _must_be_readable(section, cert=cert, key=key)
    made = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    _show(made, section, cert, key)
    return made


def _must_be_readable(section: Keys, **named: Path | None) -> None:
    faults = []
    for name, file in named.items():
        try:
            if file is not None:
                file.open("rb").close()
        except OSError as error:
            why = "no file" if isinstance(error, FileNotFoundError) else f"{error.strerror}:"
            faults.append(Setting((*section, name), f"expected a readable file, got {why} {file}"))
    if faults:
        raise ConfigError(faults)


def _show(made: ssl.SSLContext, section: Keys, cert: Path, key: Path | None) -> None:
    try:
        made.load_cert_chain(cert, key, password="")  # without one, OpenSSL would ask for it on the terminal
    except ssl.SSLError as error:
        wanted = "expected a certificate as PEM and its own key, which no password locks"
        raise SettingError((*section, "cert"), f"{wanted}, got {cert} and {key or cert}") from error

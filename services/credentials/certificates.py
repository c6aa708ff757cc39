"""A small certificate authority for one apartment: its own certificate, and those of broker, dashboard and database.

Not here: where the files go, `folder.py`. The only file that knows the library.
"""

from __future__ import annotations

import hashlib
import ipaddress
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from services.errors import ConfigError

AUTHORITY_DAYS = 3650  # it is renewed by hand only, since every client has to be given the new one
SERVER_DAYS = 730  # renewed by a timer long before
EARLIER = timedelta(hours=1)  # a machine without a clock of its own may be behind


@dataclass(frozen=True)
class Pair:
    """A certificate and its private key, both PEM."""

    certificate: str
    key: str = field(repr=False)


def authority(name: str, now: datetime) -> Pair:
    """A new authority; it may sign servers, and no further authority."""
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    usage = _usage(sign_certificates=True)
    builder = (
        _builder(subject, subject, key.public_key(), now, AUTHORITY_DAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
    )
    return _pair(builder.sign(key, hashes.SHA256()), key)


def server(signer: Pair, name: str, hosts: Sequence[str], now: datetime, old: Pair | None = None) -> Pair:
    """A certificate for a server that is reached by these names and addresses, with a new key or that of the `old` one.

    Who knows a server by its key alone, as OpenHAB does, knows it after a renewal too.
    """
    issuer, signing = _certificate(signer), _key(signer)
    key = _kept(old) or ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    builder = (
        _builder(subject, issuer.subject, key.public_key(), now, SERVER_DAYS)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(sign_certificates=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(x509.SubjectAlternativeName([_host(one) for one in hosts]), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(signing.public_key()), critical=False)
    )
    return _pair(builder.sign(signing, hashes.SHA256()), key)


def ends(certificate: str) -> datetime:
    """Until when a certificate (PEM) holds, UTC."""
    return _read(certificate).not_valid_after_utc


def hosts(certificate: str) -> list[str]:
    """The names and addresses that a server's certificate (PEM) is for."""
    names = _read(certificate).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    return [str(one.value) for one in names]


def pin(certificate: str) -> str:
    """The hash of a certificate's (PEM) public key, in the form that OpenHAB's MQTT binding compares."""
    key = _read(certificate).public_key()
    told = key.public_bytes(serialization.Encoding.DER, serialization.PublicFormat.SubjectPublicKeyInfo)
    return f"SHA-256:{hashlib.sha256(told).hexdigest().upper()}"


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, now: datetime, days: int
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - EARLIER)
        .not_valid_after(now + timedelta(days=days))
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key), critical=False)
    )


def _usage(*, sign_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not sign_certificates,
        key_cert_sign=sign_certificates,
        crl_sign=sign_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _host(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        pass
    try:
        return x509.DNSName(name)
    except ValueError as error:
        raise ConfigError([f"--host: expected a host name or an address, got {name!r}"]) from error


def _pair(certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> Pair:
    pem = serialization.Encoding.PEM
    private = key.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    return Pair(certificate.public_bytes(pem).decode(), private.decode())


def _read(certificate: str) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(certificate.encode())
    except ValueError as error:
        raise ConfigError([f"expected a certificate in PEM: {error}"]) from error


def _certificate(pair: Pair) -> x509.Certificate:
    return _read(pair.certificate)


def _kept(old: Pair | None) -> ec.EllipticCurvePrivateKey | None:
    """The key of an earlier certificate, where it is one of our kind."""
    key = serialization.load_pem_private_key(old.key.encode(), password=None) if old is not None else None
    return key if isinstance(key, ec.EllipticCurvePrivateKey) else None


def _key(pair: Pair) -> ec.EllipticCurvePrivateKey:
    key = serialization.load_pem_private_key(pair.key.encode(), password=None)
    assert isinstance(key, ec.EllipticCurvePrivateKey)
    return key

"""The commands `apartment openhab ...`: what they are given, what they print. The work is in `services/openhab/`."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from services import document, secret_store
from services.command_line.options import CONFIG, Config, Json, Unread
from services.config import Apartment, load
from services.errors import ConfigError

if TYPE_CHECKING:  # the grammars and HTTP, for these commands alone: every process of a service loads this module
    from services.openhab.folder import Plan
    from services.openhab.site import Broker, BusDesign, Camera

DESIGNS = ("dsl", "js", "links")
TLS_PORT = 8883  # of mosquitto/tls.conf
SERVICE = re.compile(r"[a-z0-9]+")  # of OpenHAB's persistence: it becomes the name of a file
app = typer.Typer(no_args_is_help=True, help="OpenHAB's files: write them, check them, make a home.yaml of them.")
OpenHab = Annotated[str, typer.Option("--openhab", help="2.5, 3, 4, 5, or a release such as 4.2.")]


@app.command(name="generate", epilog="Example: apartment openhab generate --openhab 5 --out /etc/openhab")
def generate_(
    out: Annotated[Path, typer.Option("--out", help="OpenHAB's configuration folder, or one of your own.")],
    openhab: OpenHab = "5",
    bus: Annotated[str, typer.Option(help="Rules in OpenHAB's language (dsl) or JavaScript (js), or links.")] = "dsl",
    persistence: Annotated[str, typer.Option(help="OpenHAB's own: jdbc, mysql, or none.")] = "jdbc",
    broker: Annotated[str | None, typer.Option(help="host:port of the broker as OpenHAB reaches it.")] = None,
    tls: Annotated[bool, typer.Option("--tls", help="By TLS, as from another machine; port 8883.")] = False,
    diff: Annotated[bool, typer.Option("--diff", help="Show what would change, and change nothing.")] = False,
    config: Config = CONFIG,
) -> None:
    """Write OpenHAB's files from the model of the home. Files of others are never touched."""
    from services.openhab import folder as folders
    from services.openhab.generate import files, left_out
    from services.openhab.site import Site
    from services.openhab.versions import parse

    if bus not in DESIGNS:
        raise ConfigError([f"--bus: expected one of {', '.join(DESIGNS)}, got {bus!r}"])
    if not SERVICE.fullmatch(persistence):
        raise ConfigError([f"--persistence: expected the name of a service such as jdbc, got {persistence!r}"])
    version = parse(openhab)
    apartment = load(config, ())
    known = folders.taken(out, version) if out.is_dir() else {}
    site = Site(
        apartment.home, version, _cameras(apartment), _broker(apartment, broker, tls=tls), cast("BusDesign", bus),
        None if persistence == "none" else persistence, frozenset(known),
    )  # fmt: skip
    plan = folders.plan(out, files(site))
    if wrong := folders.faults(plan, version):
        raise ConfigError(wrong)
    if diff:
        typer.echo(folders.diff(plan), nl=False)
    else:
        folders.apply(plan)
        _tell(plan)
    for path in plan.foreign:
        typer.echo(f"{out / path}: not ours, left as it is", err=True)
    for name in left_out(site):
        typer.echo(f"{name}: stands in {known[name]} already, left out of ours", err=True)
    if plan.foreign:
        raise typer.Exit(1)


def _tell(plan: Plan) -> None:
    for path in plan.written:
        typer.echo(f"wrote {plan.folder / path}")
    for path in plan.gone:
        typer.echo(f"removed {plan.folder / path}")
    typer.echo(f"{len(plan.wanted) - len(plan.written) - len(plan.foreign)} files were right already.")


def _broker(apartment: Apartment, text: str | None, *, tls: bool) -> Broker:
    from services.openhab.site import Broker

    host, _, port = (text or "").rpartition(":") if text and ":" in text else (text or "", "", "")
    if port and not port.isdigit():
        raise ConfigError([f"--broker: expected host:port, got {text!r}"])
    settings = apartment.bus
    usual = TLS_PORT if tls and settings.tls is None else settings.port
    secure = tls or settings.tls is not None
    return Broker(
        host or settings.host, int(port) if port else usual, secure, public_key=_public_key() if secure else None
    )


def _public_key() -> str | None:
    """The hash of our broker's public key, by which OpenHAB is to know it; None where its certificate is not here."""
    from services.credentials import certificates
    from services.credentials.folder import Folder

    named = os.environ.get("APARTMENT_SECRETS")
    folder = Folder(Path(named).parent if named else secret_store.home())
    try:
        pair = folder.pair("broker")
    except OSError as error:
        text = f"{folder.path / 'broker'}: expected a certificate that can be read, got {error.strerror}"
        raise ConfigError([text]) from error
    if pair is None:
        typer.echo(
            f"{folder.path / 'broker'}: no certificate, so OpenHAB will trust the first one that it sees", err=True
        )
        return None
    return certificates.pin(pair.certificate)


def _cameras(apartment: Apartment) -> tuple[Camera, ...]:
    return tuple(_camera(apartment, name) for name in apartment.cameras)


def _camera(apartment: Apartment, name: str) -> Camera:
    """A camera as its section says; its addresses are those of our proxy, where it has a fixed one."""
    from services.camera.places import Places
    from services.openhab.site import Camera

    settings: Any = apartment.instances[f"camera-{name}"].config
    stream = settings.stream
    base = stream.url or (f"http://{stream.host}:{stream.port}" if stream.port else None)
    places = tuple(Places(settings.folder / settings.places).named) if settings.places else ()
    address = f"{base.rstrip('/')}/camera/{name}" if base is not None else None
    return Camera(
        name,
        places,
        tuple(settings.targets),
        f"{address}/stream.mjpg" if address else None,
        f"{address}/snapshot.jpg" if address else None,
    )


@app.command(name="check", epilog="Example: apartment openhab check --openhab 4 items/ sitemaps/home.sitemap")
def check_(
    files: Annotated[list[Path], typer.Argument(help="Files, or folders of them.")],
    openhab: OpenHab = "5",
    json: Json = False,
    live: Annotated[
        str | None, typer.Option("--live", help="A running OpenHAB (5.1 on) to ask too; its token: OPENHAB_TOKEN.")
    ] = None,
    _config: Unread = CONFIG,
) -> None:
    """Check files of OpenHAB as strictly as it does itself; exit 1 when one has an error."""
    from services.openhab import folder as folders
    from services.openhab.check import KINDS, check
    from services.openhab.versions import parse

    texts = folders.texts(files)
    unknown = [name for name in texts if Path(name).suffix not in KINDS]
    if unknown:
        raise ConfigError([f"{name}:1: file: expected one of {', '.join(KINDS)}" for name in unknown])
    version = parse(openhab)
    found = check(texts, version)
    if live is not None:
        from services.openhab.live import check as ask  # HTTP, for this alone

        found = sorted([*found, *ask(texts, live.rstrip("/"), secret_store.lookup()("OPENHAB_TOKEN"))])
    if json:
        import json as form

        typer.echo(form.dumps([vars(one) for one in found], ensure_ascii=False))
    else:
        for one in found:
            typer.echo(str(one))
        typer.echo(f"{len(texts)} files for OpenHAB {version}: {_counted(found)}.", file=sys.stderr)
    if any(one.severity == "error" for one in found):
        raise typer.Exit(1)


def _counted(found: list[Any]) -> str:
    errors = sum(one.severity == "error" for one in found)
    return f"{errors} errors, {len(found) - errors} warnings" if found else "good"


@app.command(name="import", epilog="Example: apartment openhab import /etc/openhab --out home.yaml")
def import_(
    folder: Annotated[Path, typer.Argument(help="OpenHAB's configuration folder, or any with .items and .things.")],
    out: Annotated[Path, typer.Option("--out", help="Where the home goes.")] = Path("home.yaml"),
    openhab: Annotated[str | None, typer.Option("--openhab", help="Whose grammars; else the best of all.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is there.")] = False,
    _config: Unread = CONFIG,
) -> None:
    """Make a home.yaml of a site's items, things and persistence; exit 1 when a file could not be read whole."""
    from services.openhab import folder as folders
    from services.openhab.importing import best_version, home_of
    from services.openhab.versions import parse

    texts = folders.texts([folder])
    if not any(name.endswith(".items") for name in texts):
        raise ConfigError([f"{folder}:1: file: expected a folder with .items files, got none"])
    if out.exists() and not force:
        raise ConfigError([f"{out}:1: file: expected none there, or --force to replace it"])
    version = parse(openhab) if openhab is not None else best_version(texts)
    home, found = home_of(texts, version)
    document.write(out, home.model_dump(mode="json", exclude_defaults=True))
    for one in found:
        typer.echo(str(one), err=True)
    typer.echo(f"wrote {out}: {len(home.items)} items, {len(home.things)} things, {len(home.rooms)} rooms.")
    if any(one.severity == "error" for one in found):
        raise typer.Exit(1)

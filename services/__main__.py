"""The command line: `apartment ...`, or `python -m services ...`. One short function each.

Exit codes: 0 done, 1 the thing asked for did not happen, 2 wrong usage or configuration, 130 Ctrl-C.
"""

from __future__ import annotations

import logging
import signal
import sys
from dataclasses import asdict
from json import dumps
from pathlib import Path
from typing import Annotated

import typer

from services import access, process, secret_store
from services.command_line import (
    backup,
    bench,
    calibrate,
    completion,
    dashboard,
    doctor,
    install,
    mission,
    openhab,
    order,
    record,
    replay,
    scan,
    secrets,
    status,
    steer,
    stored,
    watch,
)
from services.command_line.options import CONFIG, SERVICES, Config, Json, Screen, Unread, out
from services.config import Apartment, load
from services.errors import ApartmentError, ConfigError, words
from services.supervisor import Supervisor, commands, processes, simulated
from services.topics import asyncapi, page

app = typer.Typer(
    no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None,
    help="A smart apartment, its ceiling camera and a ROS 1 robot on one MQTT event bus.",
)  # fmt: skip
err = Screen(stderr=True)


@app.command(epilog="Example: apartment run --config config/simulated.yaml")
def run(services: Annotated[list[str] | None, SERVICES] = None, config: Config = CONFIG) -> None:
    """Start services (all that the configuration has), one process each, and keep them running."""
    process.log_to_stderr()
    apartment = load(config, tuple(services) if services else None, deep=True)
    groups = processes(apartment, _names(apartment, services))
    supervisor = Supervisor(commands(groups, config.resolve()), last=simulated(apartment, groups))
    broker = {"host": apartment.bus.host, "port": apartment.bus.port}
    with process.stop_signals(supervisor.stop):
        supervisor.run(lambda ready: _say(process.ready_line("run", {"broker": broker, "services": ready})))


@app.command(epilog="Example: apartment serve bridge")
def serve(services: Annotated[list[str], SERVICES], config: Config = CONFIG) -> None:
    """Run services in this process, one mostly: what `run` and systemd start."""
    process.log_to_stderr()
    apartment = load(config, tuple(services))
    _names(apartment, services)
    process.serve(apartment, services, lambda addresses: _say(process.ready_line("+".join(services), addresses)))


@app.command(epilog="Example: apartment simulate camera --config config/simulated.yaml")
def simulate(
    what: Annotated[str, typer.Argument(help="camera, camera-NAME of several, or home")], config: Config = CONFIG
) -> None:
    """Run one simulator alone."""
    serve([f"simulated-{what}"], config)


@app.command(epilog="Example: apartment demo --once")
def demo(
    once: Annotated[bool, typer.Option("--once", help="End by itself once the marker was found.")] = False,
    _config: Unread = CONFIG,
) -> None:
    """Run the whole apartment, simulated, and tell its story."""
    from services import demo as story  # it brings every service's libraries

    process.log_to_stderr(logging.ERROR)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # what was started is ended on the way out
    if not story.demo(out, once=once):
        raise typer.Exit(1)


@app.command(epilog="Example: apartment check --config config/apartment.yaml")
def check(config: Config = CONFIG) -> None:
    """Check a configuration and every file that it names: lists every fault with file and line."""
    from services.credentials import strength

    apartment = load(config, deep=True)
    if weak := strength.faults(apartment):
        raise ConfigError(weak)
    cameras = ", ".join(apartment.cameras) or "none"
    out.print(f"{config}: good. Services: {', '.join(apartment.instances)}. Cameras: {cameras}.")


@app.command(name="topics", epilog="Example: apartment topics --write bus_topics.md")
def topics_(
    write: Annotated[Path | None, typer.Option(help="Write the table there.")] = None,
    acl: Annotated[Path | None, typer.Option(help="Write the broker's access list there.")] = None,
    passwords: Annotated[Path | None, typer.Option(help="Write the broker's password file there.")] = None,
    as_asyncapi: Annotated[bool, typer.Option("--asyncapi", help="Show it as an AsyncAPI 3 document.")] = False,
    config: Config = CONFIG,
) -> None:
    """Show the table of topics, or write the files that come from it and from the accounts of the configuration."""
    if write is not None:
        write.write_text(page.markdown(), encoding="utf-8")
    if acl is not None:
        apartment = load(config)
        acl.write_text(access.acl(apartment.cameras, apartment.home), encoding="utf-8")
    if passwords is not None:
        accounts = load(config).bus.accounts
        access.write_passwords(passwords, {name: one.get_secret_value() for name, one in accounts.items() if one})
    if as_asyncapi:
        _say(dumps(asyncapi.document(), indent=1))
    elif write is acl is passwords is None:
        _say(page.markdown())


@app.command(epilog="Example: apartment probe ip1 --url http://192.0.2.9 --user ros")
def probe(
    camera: Annotated[str, typer.Argument(help="A camera of the configuration, or with --url a name for a new one.")],
    url: Annotated[str | None, typer.Option(help="Where a camera is that is not configured yet.")] = None,
    user: Annotated[
        str, typer.Option(help="Who logs in there; the password is asked, or CAMERA_<NAME>_PASSWORD.")
    ] = "admin",
    certificate: Annotated[
        Path | None, typer.Option(help="With --url https://...: the certificate that the camera has to show, as PEM.")
    ] = None,
    out_folder: Annotated[Path | None, typer.Option("--out", help="Where files go; default probe-<camera>.")] = None,
    yes_move: Annotated[
        bool, typer.Option("--yes-move", help="It may move; without this the terminal is asked.")
    ] = False,
    config: Config = CONFIG,
    json: Json = False,
) -> None:
    """Meet a camera: find out what it is and how its firmware behaves, without harm; write its configuration."""
    from services.camera.probe import command  # HTTP, for this command alone
    from services.simulators.camera.firmwares import PROFILES

    if url is not None:
        target = command.stranger(camera, url, user, secret_store.lookup(), certificate)
    else:
        known = load(config, (f"camera-{camera}",)).instances
        if f"camera-{camera}" not in known:
            raise ConfigError([f"{config}:1: cameras: expected {camera!r} there, or its address with --url"])
        target = command.configured(camera, known[f"camera-{camera}"].config)
    process.exit_when_told()  # what turns is stopped on the way out
    folder, firmwares = out_folder or Path(f"probe-{camera}"), {name: asdict(one) for name, one in PROFILES.items()}
    command.run(out, target, folder, firmwares, yes_move=yes_move, json_only=json)


app.command(epilog="Example: apartment order ip1 Goto Kitchen")(order.order)
app.command(epilog="Example: apartment scan ip1 --target 582 17")(scan.scan)
stored.add_to(app)
app.command(epilog="Example: apartment backup apartment.zip")(backup.backup)
app.command(epilog="Example: apartment restore apartment.zip")(backup.restore)
app.command(epilog="Example: apartment doctor")(doctor.doctor)
app.command(epilog="Example: apartment bench --part bus --runs 3")(bench.bench)
app.command(epilog="Example: apartment install --dry-run")(install.install)
app.command(epilog="Example: apartment completion bash >> ~/.bashrc")(completion.completion)
app.command(epilog="Example: apartment status --live")(status.status)
app.command(epilog="Example: apartment log camera-ip1 debug")(steer.log)
app.command(epilog="Example: apartment reload camera-ip1")(steer.reload)
app.command(epilog="Example: apartment watch 'camera/#' 'home/+/state'")(watch.watch)
app.command(epilog="Example: apartment record evening.jsonl.gz 'home/#' 'camera/#'")(record.record)
app.command(epilog="Example: apartment replay evening.jsonl.gz --speed 10 --only 'home/+/state'")(replay.replay)
app.add_typer(calibrate.app, name="calibrate")
app.add_typer(dashboard.app, name="dashboard")
app.add_typer(mission.app, name="mission")
app.add_typer(openhab.app, name="openhab")
app.add_typer(secrets.app, name="secrets")


def _names(apartment: Apartment, wanted: list[str] | None) -> list[str]:
    known = list(apartment.instances)
    unknown = [name for name in wanted or [] if name not in known]
    if unknown:
        raise ConfigError([f"{apartment.file}:1: services: expected of {', '.join(known)}, got {', '.join(unknown)}"])
    return list(wanted or known)


def _say(text: str) -> None:
    print(text, flush=True)


def main() -> None:
    """Runs the command line; every error of ours becomes a line and an exit code, never a traceback."""
    if any(":=" in one for one in sys.argv):
        from services.bridge import arguments  # roslaunch starts us

        sys.argv[1:] = arguments.take(sys.argv[1:])
    completion.prepare()
    try:
        app(standalone_mode=True)
    except ConfigError as error:
        for fault in error.faults:
            err.print(fault, style="red")
        sys.exit(2)
    except (ApartmentError, TimeoutError) as error:
        err.print(str(error), style="red")
        sys.exit(1)
    except OSError as error:  # of a service that ran, its log has the story
        err.print(words(error), style="red")
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()

"""Puts a camera's service together from its configuration, and takes it down so that nothing moves afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from math import radians

import numpy as np

from services import document
from services.apartment import zoom_levels
from services.camera.address import Address
from services.camera.alarm.listener import Listener
from services.camera.calibration.study import Studio
from services.camera.lanes import Lanes
from services.camera.places import Places
from services.camera.scan.analysis import Pool
from services.camera.scan.sightings import Eye
from services.camera.service import CameraService
from services.camera.settings import Config
from services.camera.sound.desk import Desk
from services.camera.video.channel import Channel
from services.camera.watchdog import Watchdog, brand, connector
from services.camera.web.gate import Gate
from services.errors import ConfigError
from services.runner import Post
from services.tls import peer_context
from services.vision.lens import Lens


@contextmanager
def start(config: Config, post: Post) -> Iterator[CameraService]:
    """The service, with its threads to the camera; at the end a stop is sent and confirmed."""
    certificate(config)
    view, address, gate = eye(config), config.address, Gate(config.login_retry_s)
    with ExitStack() as stack:  # what was opened last is closed first: nobody gives an order while the motors are ended
        channel = stack.enter_context(closing(Channel(config.name, config.stream, address, config.kind, post, gate)))
        lock = config.state and config.state / "cameras" / f"{config.name}.lock"
        watchdog = stack.enter_context(closing(Watchdog(config.brand, address, lock)))
        device = Lanes(connector(config.brand, address, gate), post, turning=watchdog.tell, owing=gate.owe)
        made_sound = getattr(brand(config.brand), "sound", None)
        desk = Desk(device, made_sound(address, gate) if made_sound else None, post)
        sender = stack.enter_context(closing(Studio(desk, post)))
        listener = _listener(config, address, gate, post)
        if listener is not None:
            stack.callback(listener.close)
        hears = listener is not None
        service = CameraService(config, sender, lambda: Pool(post, config.workers), view, channel, hears=hears)
        yield stack.enter_context(closing(service))


def _listener(config: Config, address: Address, gate: Gate, post: Post) -> Listener | None:
    """The thread that hears the camera's alarms; None when they are switched off, or the brand has none."""
    ear = getattr(brand(config.brand), "ear", None)
    if ear is None or not config.alarm:
        return None
    return Listener(config.name, ear(address, gate, config.motion.codes, config.motion.heartbeat_s), post)


def check(config: Config) -> None:
    """ConfigError with every fault of the files that the configuration names: certificate, calibration, places."""
    faults: list[str] = []
    for read in (lambda: certificate(config), lambda: eye(config), lambda: Places(config.folder / config.places)):
        try:
            read()
        except ConfigError as error:
            faults += error.faults
    if faults:
        raise ConfigError(faults)


def certificate(config: Config) -> None:
    """ConfigError when the file that the camera's certificate is to be in cannot be used."""
    if (file := config.address.certificate) is not None:
        peer_context(("cameras", config.name, "certificate"), file)


def eye(config: Config) -> Eye:
    """What is known of the camera's geometry; ConfigError when its file cannot be used."""
    lens = None
    if config.camera_info is not None:
        file = config.folder / config.camera_info
        try:
            lens = Lens.from_camera_info(document.must(document.read(file)))
        except (ValueError, AttributeError) as error:
            raise ConfigError([f"{file}:1: {error}"]) from error
    mount = config.mount.mount() if config.mount else None
    zoom = (
        zoom_levels.read(zoom_levels.of_lens(config.folder / config.camera_info))
        if config.camera_info is not None
        else ()
    )
    widest, noise, (doubt_m, doubt_deg) = config.zoom_range[0], config.reading_noise_deg, config.mount_doubt
    doubt = np.diag(np.square([doubt_m] * 3 + [radians(doubt_deg)] * 3))
    return Eye(config.name, config.dictionary, lens, mount, widest, zoom, angle_noise_deg=noise, mount_doubt=doubt)

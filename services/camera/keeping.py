"""Saving and removing places, as plans: which of the camera's presets a place gets, and which are let alone.

A camera lets a preset be overwritten without a word, and some are the owner's: it is asked first which it keeps. Where
that does not become known a place has none, and its coordinates are enough. The files themselves are `places.py`.
"""

from __future__ import annotations

import logging
from typing import cast

from services.camera import orders
from services.camera.bulletin import Bulletin
from services.camera.capabilities import Abilities
from services.camera.device import Away, ClearPreset, Refused, SavePreset, Status
from services.camera.errands import GetPresets
from services.camera.places import Places
from services.camera.plan import Plan, ask, attempt
from services.camera.ptz.stand import settle
from services.payloads import Place

log = logging.getLogger(__name__)


class Keeper:
    """Remembers the presets that are promised to places which are being saved, and why the last one got none."""

    def __init__(self, places: Places, bulletin: Bulletin, abilities: Abilities) -> None:
        self.places, self.bulletin, self.abilities = places, bulletin, abilities
        self._promised: dict[str, int] = {}
        self._why_none = ""

    def save(self, order: orders.SavePlace, now: float) -> Plan[None]:
        """Keeps where the camera looks, in a preset of the camera too where there is one for it."""
        self._must_stand()
        try:
            preset = yield from self._preset(order.place)
            reading, _ = yield from settle(ours=False)  # after the question: the preset is made of where it looks now
            self._must_stand()
            kept = preset is not None and (yield from self._is_kept(order.place, preset))
            number = preset if kept else None
            self.places.save(order.place, Place(pan=reading.pan, tilt=reading.tilt, zoom=reading.zoom, preset=number))
        finally:
            self._promised.pop(order.place, None)

    def remove(self, order: orders.RemovePlace, now: float) -> Plan[None]:
        """Forgets a place, and its preset unless another place has that too."""
        preset = self.places.get(order.place).preset
        self.places.remove(order.place)
        if preset is not None and preset not in self.places.presets:
            yield from attempt(ClearPreset(preset))

    def _must_stand(self) -> None:
        """Refused while it turns, or somebody has the motors: whose motion it is, it is not ended for this."""
        if self.bulletin.turning or self.bulletin.health.moving:
            raise Refused("the camera is moving")

    def _preset(self, name: str) -> Plan[int | None]:
        """The one that it has already, else one that is nobody's; None when that is not known, or none is left."""
        old = self.places.named.get(name)
        if old is not None and old.preset is not None:
            return old.preset
        told = yield from attempt(GetPresets())
        if isinstance(told.error, Away):
            yield from ask(Status())  # some answer everything but this question
        if told.error is not None:
            self._has_none(name, f"the camera does not say which it keeps: {told.error}")
            return None
        most = self.abilities.present.presets if self.abilities.present is not None else 0
        taken = {*cast(frozenset[int], told.result), *self._promised.values()}
        number = self._promised.get(name) or self.places.free_preset(taken, most)
        if number is None:
            self._has_none(name, f"all {most} are taken")
        else:
            self._promised[name] = number
        return number

    def _is_kept(self, name: str, preset: int) -> Plan[bool]:
        saved = yield from attempt(SavePreset(preset))
        if isinstance(saved.error, Away):
            raise saved.error
        if saved.error is None:
            self._why_none = ""
        else:
            self._has_none(name, str(saved.error))
        return saved.error is None

    def _has_none(self, name: str, why: str) -> None:
        """Says so once, and again when it is for another reason."""
        if why != self._why_none:
            log.warning("%s: the place %r is saved without a preset: %s", self.bulletin.camera, name, why)
        self._why_none = why

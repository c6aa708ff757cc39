"""The orders that do not turn the camera, as plans: targets, picture options, reboot; places are `keeping.py`'s."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from services.camera import commands, orders
from services.camera.bulletin import Bulletin
from services.camera.calibration.calibrator import Calibrator
from services.camera.calibration.wishes import TakeLens
from services.camera.device import Away, Picture, Reboot, Refused, Reply, SetPicture, Status
from services.camera.health import Health
from services.camera.keeping import Keeper
from services.camera.looks import Looks
from services.camera.orders import Command
from services.camera.plan import Plan, ask, attempt, wait
from services.camera.ptz.trips import Trips
from services.camera.scan.scanner import Scanner
from services.camera.sound.takes import Takes
from services.camera.video.feed import Feed

# These are taken while it is away too; a stream can be switched off then.
WITHOUT_CAMERA = orders.ShowScan | orders.Targets | orders.Routine | orders.Broadcast | TakeLens
PICTURE = orders.Options | commands.VideoMode | commands.HideLens  # after these all of it is another one
DOWN_S = 20.0  # a camera that still answers so long after the order does not reboot (or was too quick to be seen)
UP_S = 180.0  # 40 to 105 s were seen


class Chores:
    """Makes the plan for each of these orders. `changing`: how many that change the picture are being carried out."""

    def __init__(
        self,
        trips: Trips,
        scanner: Scanner,
        health: Health,
        bulletin: Bulletin,
        feed: Feed,
        takes: Takes,
        calibrator: Calibrator,
    ) -> None:
        self.places = trips.places
        self.scanner = scanner
        self.health = health
        self.bulletin = bulletin
        self.looks = Looks(bulletin.facts)
        self.keeper = Keeper(trips.places, bulletin, trips.abilities)
        self.takes = takes
        self.changing = 0
        self._plans: dict[type, Callable[[Any, float], Plan[None]]] = {
            orders.SavePlace: self.keeper.save,
            orders.RemovePlace: self.keeper.remove,
            orders.ShowScan: self._show,
            orders.Targets: self._targets,
            orders.Routine: self._routine,
            orders.Options: self._options,
            commands.VideoMode: lambda order, now: self.looks.mode(order),
            commands.HideLens: lambda order, now: self.looks.privacy(order),
            commands.RecordSound: lambda order, now: self.takes.record(order, now),
            commands.PlaySound: lambda order, now: self.takes.play(order, now),
            orders.Broadcast: feed.switch,
            orders.Restart: self._restart,
            TakeLens: calibrator.take_lens,
        }

    def plan(self, command: Command, now: float) -> Plan[None]:
        """The plan; it raises Refused or another DeviceError when the order cannot be carried out."""
        plan = self._plans[type(command)](command, now)
        return self._change(plan) if isinstance(command, PICTURE) else plan

    def _change(self, plan: Plan[None]) -> Plan[None]:
        self.changing += 1
        try:
            yield from plan
        finally:
            self.changing -= 1

    def _show(self, order: orders.ShowScan, now: float) -> Plan[None]:
        self.scanner.show = order.on
        yield from ()

    def _targets(self, order: orders.Targets, now: float) -> Plan[None]:
        self.scanner.targets = orders.changed(self.scanner.targets, order)
        yield from ()

    def _routine(self, order: orders.Routine, now: float) -> Plan[None]:
        if order.places is not None:
            for name in order.places:
                self.places.get(name)
        self.scanner.routine = order.places
        yield from ()

    def _options(self, order: orders.Options, now: float) -> Plan[None]:
        wanted = order.request
        reply = yield from ask(wanted)
        if not _has(cast(Picture, reply.result), wanted):
            raise Refused("the camera said OK, but its settings have not changed")

    def _restart(self, order: orders.Restart, now: float) -> Plan[None]:
        ordered = yield from attempt(Reboot())
        if ordered.error is not None and not isinstance(ordered.error, Away):
            raise ordered.error
        self.health.reboot()
        why_not = "its restart was given up"
        try:
            yield from self._comes_back(ordered)
            why_not = ""
        except Away as error:
            why_not = str(error)
            raise
        finally:
            self.health.rebooted(why_not=why_not)

    def _comes_back(self, ordered: Reply) -> Plan[None]:
        """Until it answers again; Away when it does not, or when the order itself got lost (some go without a word)."""
        began, was_down, reply = ordered.received, False, ordered
        while True:
            now = yield from wait(reply.received + 1.0)
            reply = yield from attempt(Status())
            was_down = was_down or isinstance(reply.error, Away)
            if reply.error is None and was_down:
                return
            if reply.error is None and now - began > DOWN_S:
                if ordered.error is not None:
                    raise ordered.error
                return
            if now - began > UP_S:
                raise Away(f"it has not come back within {UP_S:.0f} s")


def _has(picture: Picture, wanted: SetPicture) -> bool:
    pairs = ((wanted.flip, picture.flip), (wanted.mirror, picture.mirror), (wanted.mode, picture.mode))
    return all(want is None or want == has for want, has in pairs)

"""Moves to a place or to readings, as they are ordered: the goal, what helps on the way, and what is kept of them.

Not here: how to get there (`move.py`), who has the motors (`motors.py`).
"""

from __future__ import annotations

from services.camera.bulletin import Bulletin
from services.camera.capabilities import Abilities
from services.camera.device import Identity, Picture
from services.camera.orders import Calibration, Command, GotoPlace, LookAt, MoveBy
from services.camera.places import Places
from services.camera.plan import Plan
from services.camera.ptz.calibrate import calibrate
from services.camera.ptz.goal import Goal, Pose
from services.camera.ptz.kept import Kept
from services.camera.ptz.move import Arrival, goto
from services.camera.ptz.skill import Skill
from services.camera.settings import Config


class Trips:
    """The moves of one camera; `skill` is what they teach."""

    def __init__(self, config: Config, bulletin: Bulletin, places: Places, abilities: Abilities) -> None:
        self.config, self.bulletin, self.places, self.abilities = config, bulletin, places, abilities
        self.kept = Kept(config.state, config.name)
        self.skill = Skill()
        self.skill.forget_senses(flip=config.picture.flip, mirror=config.picture.mirror)

    def meet(self, identity: Identity) -> None:
        """It is known which camera this is."""
        self.kept.recall(identity, self.skill)

    def see(self, picture: Picture, old: Picture) -> None:
        """The motors follow the picture: when its options changed, which way they turn is to be seen anew."""
        if (picture.flip, picture.mirror) != (old.flip, old.mirror):
            self.skill.forget_senses(flip=picture.flip, mirror=picture.mirror)

    def goal(self, command: GotoPlace | LookAt) -> Goal:
        """Where an order wants to look; what it leaves out stays as it is. Refused: nowhere that is."""
        here = self.bulletin.known()
        if isinstance(command, GotoPlace):
            place = self.places.get(command.place)
            return self.config.limits.goal(place.pan, place.tilt, place.zoom)
        pan, tilt, zoom = self.config.limits.within(here)  # at a stop it may read a little more than its range
        return self.config.limits.goal(
            pan if command.pan is None else command.pan,
            tilt if command.tilt is None else command.tilt,
            zoom if command.zoom is None else command.zoom,
        )

    def plan(self, command: GotoPlace | LookAt, now: float) -> Plan[Arrival]:
        """The move."""
        self._believe()
        near, until = self.bulletin.at_rest(now), now + self.config.move_timeout_s
        goal, limits, presets = self.goal(command), self.config.limits, self._presets()
        return (yield from goto(goal, limits, self.skill, until, near=near, presets=presets))

    def calibrate(self) -> Plan[Arrival]:
        """Learns the motors on purpose."""
        self._believe()
        return (yield from calibrate(self.config.limits, self.skill))

    def keep(self, command: Command | None) -> None:
        """What an order taught is kept, once it has ended; of a calibration, on the disk by now."""
        if not isinstance(command, MoveBy):
            self.kept.save(self.skill)
        if isinstance(command, Calibration):
            self.kept.written()

    def _believe(self) -> None:
        told = self.abilities.present
        if told is not None:
            self.skill.believe(absolute=told.absolute, relative=told.relative)

    def _presets(self) -> dict[int, Pose]:
        """Where the camera's presets look, as the places say."""
        known = self.places.named.values()
        return {one.preset: (one.pan, one.tilt, one.zoom) for one in known if one.preset is not None}

"""How one motor gets about: pieces of constant acceleration, in closed form. Pure.

A motor is told a speed over time; what it does is that, except that it cannot pass its end stops: there it stands and
pushes until the told speed points away again. Not here: which motor, and why it moves (`motors`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import copysign, inf, sqrt
from typing import NamedTuple

ROUNDING_S = 1e-6  # who comes to rest exactly at an end stop may be pushing for a billionth of a second by the numbers


@dataclass(frozen=True)
class Rail:
    """One motor: from where to where it can go, its speeds 1, 2, ... and its acceleration, up and down."""

    low: float
    high: float
    speeds: tuple[float, ...]
    acceleration: float

    def within(self, position: float) -> float:
        """The nearest place that it can stand at."""
        return min(max(position, self.low), self.high)

    def speed(self, level: int) -> float:
        """The speed of a level; a level out of range counts as the nearest."""
        return self.speeds[min(max(level, 1), len(self.speeds)) - 1]


class Moment(NamedTuple):
    """Where a motor is and how fast it turns."""

    position: float
    speed: float


class Piece(NamedTuple):
    """A while of constant acceleration from a speed on; `pushes`: it stands at an end stop and wants on."""

    seconds: float
    speed: float
    acceleration: float
    pushes: bool = False

    def after(self, seconds: float) -> Moment:
        """How far it got, and how fast it is then."""
        if self.pushes:
            return Moment(0.0, 0.0)
        gone = self.speed * seconds + (self.acceleration * seconds * seconds / 2 if self.acceleration else 0.0)
        return Moment(gone, self.speed + self.acceleration * seconds)


@dataclass(frozen=True)
class Track:
    """What one motor does from `began` on; after the last piece it stands at `rest`."""

    began: float
    position: float
    pieces: tuple[Piece, ...]
    rest: float

    def at(self, now: float) -> Moment:
        """Where it is at a time, not before `began`."""
        position, left = self.position, now - self.began
        for piece in self.pieces:
            if left < piece.seconds:
                gone, speed = piece.after(left)
                return Moment(position + gone, speed)
            position, left = position + piece.after(piece.seconds).position, left - piece.seconds
        return Moment(self.rest, 0.0)

    @property
    def ends(self) -> float:
        """When it comes to rest."""
        return self.began + sum(piece.seconds for piece in self.pieces)

    def travelled(self, now: float) -> float:
        """How far it went by then, there and back both counted."""
        return sum(abs(piece.after(seconds).position) for piece, seconds in self._until(now))

    def pushed(self, now: float) -> float:
        """Seconds by then in which it pushed against an end stop."""
        return sum(seconds for piece, seconds in self._until(now) if piece.pushes and piece.seconds > ROUNDING_S)

    def _until(self, now: float) -> Iterator[tuple[Piece, float]]:
        left = now - self.began
        for piece in self.pieces:
            yield piece, min(max(left, 0.0), piece.seconds)
            left -= piece.seconds


def stand(position: float, now: float) -> Track:
    """Does nothing."""
    return Track(now, position, (), position)


def run(rail: Rail, at: Moment, now: float, speed: float, seconds: float = inf) -> Track:
    """Turns with a speed (negative: backwards; 0: comes to rest), for so long, and then comes to rest."""
    told = [*_change(at.speed, speed, rail.acceleration), *([Piece(inf, speed, 0.0)] if speed else [])]
    if seconds < inf:
        told = list(_first(told, seconds))
        told += _change(told[-1].after(told[-1].seconds).speed if told else at.speed, 0.0, rail.acceleration)
    return _track(rail, at.position, now, told)


def go(rail: Rail, at: Moment, now: float, goal: float, speed: float) -> Track:
    """Turns to a goal, clamped to the end stops, with at most this speed, and comes to rest there."""
    goal, start, told = rail.within(goal), at, []
    braking = at.speed * at.speed / (2 * rail.acceleration)
    if at.speed * (goal - at.position) < 0 or braking > abs(goal - at.position):
        brake = _track(rail, at.position, now, _change(at.speed, 0.0, rail.acceleration))
        start, told = Moment(brake.rest, 0.0), list(brake.pieces)
    distance, sign = abs(goal - start.position), copysign(1.0, goal - start.position)
    first = abs(start.speed)
    top = max(min(speed, sqrt(rail.acceleration * distance + first * first / 2)), min(first, speed))
    slopes = (abs(first * first - top * top) + top * top) / (2 * rail.acceleration)
    told += _change(sign * first, sign * top, rail.acceleration)
    told += [Piece((distance - slopes) / top, sign * top, 0.0)] if distance > slopes else []
    told += _change(sign * top, 0.0, rail.acceleration)
    return Track(now, at.position, tuple(told), goal)


def _change(before: float, after: float, acceleration: float) -> Iterator[Piece]:
    """From one speed to another, split where it turns round, so that each piece goes one way."""
    if before * after < 0:
        yield from _change(before, 0.0, acceleration)
        before = 0.0
    if before != after:
        yield Piece(abs(after - before) / acceleration, before, copysign(acceleration, after - before))


def _first(pieces: Iterable[Piece], seconds: float) -> Iterator[Piece]:
    """What is done in the first seconds."""
    for piece in pieces:
        if seconds > 0:
            yield piece._replace(seconds=min(piece.seconds, seconds))
        seconds -= piece.seconds


def _track(rail: Rail, position: float, now: float, told: Iterable[Piece]) -> Track:
    pieces = tuple(_within(rail, position, told))
    rest = rail.within(position + sum(piece.after(piece.seconds).position for piece in pieces if not piece.pushes))
    return Track(now, position, pieces, rest)


def _within(rail: Rail, position: float, told: Iterable[Piece]) -> Iterator[Piece]:
    """The pieces as they come about: what is told beyond an end stop is time that the motor pushes against it."""
    for piece in told:
        ahead = piece.speed + piece.acceleration * min(piece.seconds, 1.0) / 2
        end = rail.high if ahead > 0 else rail.low
        room = abs(end - position)
        if abs(piece.after(piece.seconds).position) <= room:
            position += piece.after(piece.seconds).position
            yield piece
            continue
        free = _time_for(room, abs(piece.speed), copysign(1.0, ahead) * piece.acceleration)
        yield piece._replace(seconds=free)
        yield piece._replace(seconds=piece.seconds - free, pushes=True)
        position = end


def _time_for(distance: float, speed: float, acceleration: float) -> float:
    """When a distance is covered that is covered some time (distance and speed not negative)."""
    root = sqrt(max(speed * speed + 2 * acceleration * distance, 0.0))
    return 2 * distance / (speed + root) if distance else 0.0

"""A mission as a picture: its way on the map, its story, and who did what when. What happened is in `timeline.py`.

Three panels: the map with the robot's track in the colours of the steps, the story in words, and below both lanes of
time for mission, goals, the robot's camera, the house's cameras and the messages on the bus.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise

from services.apartment.floor import XY
from services.mission.chart import Chart
from services.mission.plan_view import PlanView
from services.mission.timeline import Timeline
from services.paper import GREY, INK, PALE, WHITE, Colour, Paper

WIDTH = 1400
MARGIN, TOP, MIDDLE = 36.0, 84.0, 640.0
SPLIT = 830.0  # between map and story
LANE, LANES_LEFT = 34.0, 150.0
LANES = 3  # besides one for each group of messages and each camera that scanned
STEPS: dict[str, Colour] = {
    "look": (66, 133, 219), "go": (234, 146, 46), "scan": (135, 86, 196), "found": (38, 150, 86),
    "not_found": (190, 60, 60), "failed": (190, 60, 60), "cancelled": (120, 128, 140), "refused": (120, 128, 140),
}  # fmt: skip
ENDS: dict[str, Colour] = {"arrived": (38, 150, 86), "failed": (190, 60, 60), "cancelled": (120, 128, 140)}
GROUPS = ("mission", "robot", "camera")
ROWS = 24  # of the story that fit


def draw(told: Timeline, chart: Chart, cameras: Mapping[str, XY]) -> bytes:
    """The PNG; `cameras` of the house, where they hang in the apartment frame, metres."""
    scanned = len({one.camera for one in told.scans})
    paper = Paper(WIDTH, round(MIDDLE + 62 + LANE * (LANES + len(GROUPS) + scanned) + 18))
    _head(paper, told)
    view = PlanView(paper, chart, (MARGIN, TOP, SPLIT - MARGIN - 24, MIDDLE - TOP))
    view.draw(told, cameras, STEPS)
    _story(paper, told)
    _lanes(paper, told)
    return paper.png()


def _head(paper: Paper, told: Timeline) -> None:
    result = told.result
    end = result.state.replace("_", " ") if result else "under way"
    colour = STEPS.get(result.state, INK) if result else INK
    title = f"{told.robot} looks for marker {told.marker}: "
    paper.text((MARGIN, 44), title, INK, 24, 600)
    paper.text((MARGIN + paper.width(title, 24, 600) + 7, 44), end, colour, 24, 700)
    words = [f"after {told.end:.1f} s", result.reason if result else ""]
    if result is not None and result.position is not None:
        at = result.position
        words.append(f"at ({at.x:.2f}, {at.y:.2f}, {at.z:.2f}) m of the apartment")
    paper.text((MARGIN, 66), "  ·  ".join(one for one in words if one), GREY, 13)


def _story(paper: Paper, told: Timeline) -> None:
    paper.text((SPLIT, TOP + 12), "What happened", INK, 14, 600)
    row = (MIDDLE - TOP - 30) / ROWS
    steps = told.steps if len(told.steps) <= ROWS else [*told.steps[: ROWS - 8], *told.steps[-7:]]
    y = TOP + 36
    for index, step in enumerate(steps):
        if index and step is told.steps[-7:][0] and len(told.steps) > ROWS:
            paper.text((SPLIT + 114, y), f"… {len(told.steps) - ROWS + 1} more …", GREY, 11)
            y += row
        paper.text((SPLIT + 48, y), f"{step.at:.1f} s", GREY, 11, align="right")
        colour = STEPS.get(step.state, GREY)
        paper.box(SPLIT + 56, y - 10, 50, 14, colour)
        paper.text((SPLIT + 81, y), step.state.replace("_", " ")[:9], WHITE, 10, 600, "middle")
        words = paper.fitting(step.text or step.state, 11, WIDTH - MARGIN - SPLIT - 114)
        paper.text((SPLIT + 114, y), words, INK, 11)
        y += row


class _Lanes:
    """From seconds to the sheet, lane by lane."""

    def __init__(self, paper: Paper, told: Timeline) -> None:
        self.paper, self.told = paper, told
        self._across = (WIDTH - MARGIN - LANES_LEFT) / told.end
        self.y = MIDDLE + 62

    def x(self, at: float) -> float:
        return LANES_LEFT + at * self._across

    def begin(self, name: str) -> None:
        """The next lane."""
        self.paper.text((LANES_LEFT - 12, self.y + LANE / 2 + 1), name, INK, 12, 500, "right")
        self.paper.line([(LANES_LEFT, self.y + LANE - 4), (WIDTH - MARGIN, self.y + LANE - 4)], PALE)

    def end(self) -> None:
        self.y += LANE

    def bar(self, since: float, until: float, colour: Colour, words: str, short: str = "") -> None:
        """A stretch of time with words in it, as far as they fit; `short`: instead, where they do not."""
        left, width = self.x(since), max(2.0, self.x(until) - self.x(since))
        self.paper.box(left, self.y + 6, max(1.5, width - 1), LANE - 16, colour)
        shown = next((one for one in (words, short) if one and self.paper.width(one, 10, 500) <= width - 7), "")
        if not shown and not short:
            shown = self.paper.fitting(words, 10, width - 8)
        if len(shown) > 2 or shown in (words, short):
            self.paper.text((left + 4, self.y + LANE / 2 + 2), shown, WHITE, 10, 500)


def _lanes(paper: Paper, told: Timeline) -> None:
    lanes = _Lanes(paper, told)
    _times(lanes)
    lanes.begin("mission")
    for one, other in pairwise([*told.steps, None]):
        assert one is not None
        until = other.at if other is not None else told.end
        lanes.bar(one.at, until, STEPS.get(one.state, GREY), one.state.replace("_", " "))
    lanes.end()
    lanes.begin(f"{told.robot}'s goals")
    for number, goal in enumerate(told.goals, 1):
        lanes.bar(goal.at, goal.ended or told.end, ENDS.get(goal.end, GREY), f"{number} {goal.end}", f"{number}")
    lanes.end()
    lanes.begin("its camera")
    for at, marker in told.looks:
        high = LANE - 16 if marker else (LANE - 16) / 3
        lanes.paper.box(lanes.x(at) - 1, lanes.y + LANE - 10 - high, 2, high, STEPS["found"] if marker else GREY)
    lanes.end()
    for camera in dict.fromkeys(one.camera for one in told.scans):
        lanes.begin(f"{camera} scans")
        for since, until, place in _places(told, camera):
            lanes.bar(since, until, STEPS["scan"], place)
        for sighting in told.sightings:
            if sighting.camera == camera:
                paper.dot((lanes.x(sighting.at), lanes.y + LANE / 2 - 2), 5, STEPS["found"], WHITE)
        lanes.end()
    for group in GROUPS:
        lanes.begin(f"{group}/…")
        _messages(lanes, group)
        lanes.end()


def _times(lanes: _Lanes) -> None:
    """Seconds along the top, and lines down where the steps change."""
    paper, end = lanes.paper, lanes.told.end
    paper.text((MARGIN, MIDDLE + 34), "When", INK, 14, 600)
    step = next(one for one in (1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 10**9) if end / one <= 14)
    for at in range(0, int(end) + 1, step):
        paper.text((lanes.x(at), lanes.y - 8), f"{at} s", GREY, 10, align="middle")
        paper.line([(lanes.x(at), lanes.y - 3), (lanes.x(at), paper.height - 22)], PALE)


def _messages(lanes: _Lanes, group: str) -> None:
    """A stroke a message; so many that it becomes a band are many."""
    times = [at for at, topic in lanes.told.messages if topic.startswith(f"{group}/")]
    for at in times:
        lanes.paper.box(lanes.x(at) - 0.4, lanes.y + 12, 0.8, LANE - 26, GREY)
    words = f"{len(times)}"
    lanes.paper.label((WIDTH - MARGIN - lanes.paper.width(words, 11), lanes.y + LANE / 2 + 2), words, GREY)


def _places(told: Timeline, camera: str) -> Iterator[tuple[float, float, str]]:
    """Where a camera looked in its scans, from when to when."""
    words = [one for one in told.scans if one.camera == camera]
    since, place = 0.0, ""
    for one in words:
        here = one.place if one.state == "running" else ""
        if here != place:
            if place:
                yield since, one.at, place
            since, place = one.at, here
    if place:
        yield since, told.end, place

"""Orders: each endpoint says one message on the bus, with the rights of the dashboard's account there."""

from __future__ import annotations

import uuid
from collections.abc import Awaitable, Callable

from pydantic import Field

from services import topics
from services.bus import Message
from services.dashboard.house import House
from services.dashboard.http.endpoint import Asked, Body, Done, Endpoint, one_of
from services.errors import BadMessage
from services.payloads import Free, Order, Position, PositionSet, Real
from services.payloads.robot import MissionOrder, Where


class Value(Body):
    """A command or a state in OpenHAB's string form."""

    value: str = Field(max_length=4000)


class OrderValue(Body):
    """The value of an order: what stands in the contract's table of orders."""

    value: Free = ""


class Goal(Body):
    """Where to look, degrees as the camera reads them; what is left out stays."""

    pan: Real | None = None
    tilt: Real | None = None
    zoom: Real | None = None


class Click(Body):
    """A point of the picture, as shares of its width and height from the upper left corner."""

    right: float = Field(ge=0, le=1)
    down: float = Field(ge=0, le=1)


class Find(Body):
    """The marker to be found."""

    find: int = Field(ge=0, le=9999)


class Raw(Body):
    """Any message that the dashboard's account may say; the topic decides retain and QoS."""

    topic: str = Field(max_length=400)
    payload: str = Field(max_length=60_000)


def endpoints(house: House) -> list[Endpoint]:
    """The rows."""
    desk = Desk(house)
    rows: list[tuple[str, str, Callable[[Asked], Awaitable[Done]], type[Body] | None]] = [
        ("/api/items/{item}/command", "Command an item.", desk.command, Value),
        ("/api/items/{item}/state", "Set an item's state without a command (postUpdate).", desk.set, Value),
        ("/api/cameras/{camera}/orders/{key}", "Give a camera an order.", desk.order, OrderValue),
        ("/api/cameras/{camera}/position", "Look there.", desk.position, Goal),
        ("/api/cameras/{camera}/centre", "Bring a point of the picture to its middle.", desk.centre, Click),
        ("/api/cameras/{camera}/snapshot", "Ask for a snapshot on the bus.", desk.snapshot, None),
        ("/api/missions/{robot}/find", "Send a robot to find a marker.", desk.find, Find),
        ("/api/missions/{robot}/cancel", "End the mission, and those that wait.", desk.cancel, None),
        ("/api/missions/{robot}/where", "Ask where a marker was last; answered on the bus.", desk.where, Find),
        ("/api/publish", "Say a message on the bus.", desk.publish, Raw),
    ]
    return [Endpoint("POST", path, "operator", what, does, body, Done) for path, what, does, body in rows]


class Desk:
    """See the module. BadMessage says what is wrong with an order, Unavailable that the broker is away."""

    def __init__(self, house: House) -> None:
        self.house = house

    async def command(self, asked: Asked) -> Done:
        """`home/<item>/command`."""
        return self._say(topics.HOME_COMMAND.message(asked.body.value, item=self._item(asked)))

    async def set(self, asked: Asked) -> Done:
        """`home/<item>/set`."""
        return self._say(topics.HOME_SET.message(asked.body.value, item=self._item(asked)))

    async def order(self, asked: Asked) -> Done:
        """`camera/<cam>/order/<Key>`."""
        order = Order(value=asked.body.value, id=_id())
        return self._say(topics.CAMERA_ORDER.message(order, cam=self._camera(asked), key=asked.path("key")), order.id)

    async def position(self, asked: Asked) -> Done:
        """`camera/<cam>/position/set`."""
        return self._look(self._camera(asked), **asked.body.model_dump())

    async def centre(self, asked: Asked) -> Done:
        """The same, by a point of the picture."""
        camera = self._camera(asked)
        sight = self.house.sights.get(camera)
        text = self.house.latest(topics.CAMERA_POSITION.name(cam=camera))
        if sight is None:
            raise BadMessage(f"the lens or the mount of {camera} is not known")
        if text is None:
            raise BadMessage(f"{camera} has not said where it looks")
        now = Position.model_validate_json(text)
        found = sight.centring(asked.body.right, asked.body.down, now.pan, now.tilt, now.zoom)
        if found is None:
            raise BadMessage("that point is outside what the lens shows")
        return self._look(camera, pan=round(found[0], 2), tilt=round(found[1], 2), zoom=None)

    async def snapshot(self, asked: Asked) -> Done:
        """`camera/<cam>/snapshot/get`."""
        return self._say(topics.CAMERA_SNAPSHOT_GET.message("", cam=self._camera(asked)))

    async def find(self, asked: Asked) -> Done:
        """`mission/<robot>/order`."""
        order = MissionOrder(find=asked.body.find, id=_id())
        return self._say(topics.MISSION_ORDER.message(order, robot=self._robot(asked)), order.id)

    async def cancel(self, asked: Asked) -> Done:
        """`mission/<robot>/order`, cancel."""
        return self._say(topics.MISSION_ORDER.message(MissionOrder(cancel=True), robot=self._robot(asked)))

    async def where(self, asked: Asked) -> Done:
        """`mission/<robot>/where`."""
        question = Where(marker=asked.body.find, id=_id())
        return self._say(topics.MISSION_WHERE.message(question, robot=self._robot(asked)), question.id)

    async def publish(self, asked: Asked) -> Done:
        """Anything."""
        return self._say(Message(asked.body.topic, asked.body.payload.encode()))

    def _say(self, message: Message, order: str | None = None) -> Done:
        self.house.say(message)
        return Done(id=order)

    def _look(self, camera: str, *, pan: float | None, tilt: float | None, zoom: float | None) -> Done:
        if pan is None and tilt is None and zoom is None:
            raise BadMessage("expected at least one of pan, tilt, zoom")
        goal = PositionSet(pan=pan, tilt=tilt, zoom=zoom, id=_id())
        return self._say(topics.CAMERA_POSITION_SET.message(goal, cam=camera), goal.id)

    def _item(self, asked: Asked) -> str:
        item = asked.path("item")
        if item not in self.house.config.home.items:
            raise BadMessage(f"the home has no item {item[:80]!r}")
        return item

    def _camera(self, asked: Asked) -> str:
        return one_of(self.house.config.cameras, asked.path("camera"), "camera")

    def _robot(self, asked: Asked) -> str:
        return one_of(tuple(self.house.config.robots), asked.path("robot"), "robot")


def _id() -> str:
    return f"page-{uuid.uuid4().hex[:12]}"

"""The service of one camera: orders in, plans advanced on tick, states and results out. It never waits for the camera.

It decides little itself: what an order means is `orders.py`, who has the motors and how to move `ptz/`,
how to scan `scan/`, everything else that can be ordered `chores.py`, what is said `bulletin.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from services import topics
from services.bus import LOST_TOPIC, Message
from services.camera import answers as life
from services.camera import orders
from services.camera.alarm.listener import HEARD, Heard
from services.camera.alarm.motion import MotionWatch
from services.camera.answers import Answers, Job
from services.camera.bulletin import Bulletin
from services.camera.calibration.calibrator import Calibrator
from services.camera.capabilities import Abilities
from services.camera.chores import WITHOUT_CAMERA, Chores
from services.camera.commands import VideoMode
from services.camera.device import GetPicture, Identify, Identity, Picture, Rank, Reading, Refused, Reply, Status
from services.camera.discovery import ENTITY_TOPICS, Discovery
from services.camera.early import Early
from services.camera.health import Health
from services.camera.lanes import REPLY, Sender
from services.camera.orders import Command, GotoPlace, LookAt
from services.camera.places import Places
from services.camera.plan import Plan, Run, Stage, attempt, wait
from services.camera.ptz.motors import Motors
from services.camera.ptz.trips import Trips
from services.camera.scan.analysis import ANALYSED, Analysed, Analyst
from services.camera.scan.scanner import Scanner
from services.camera.scan.sightings import Eye
from services.camera.scan.wish import ScanFor
from services.camera.settings import Config
from services.camera.sound.takes import Takes
from services.camera.upkeep import Upkeep
from services.camera.video.channel import ASKED, Channel
from services.camera.video.feed import Feed
from services.errors import BadMessage
from services.payloads import Order, OrderState, PositionSet, ScanResult, stamp

BUSY_S = 0.5  # between two looks whether the motors are free again
BROKER_LOST, ENDS = "the connection to the broker was lost", "the service ends"
FREE = WITHOUT_CAMERA | orders.Halt | orders.EndScan  # can be done while the camera is away,
IN_TURN = orders.Broadcast | orders.EndScan  # these not before what came earlier
TOPICS = (
    topics.CAMERA_ORDER,
    topics.CAMERA_POSITION_SET,
    topics.CAMERA_SNAPSHOT_GET,
    topics.CAMERA_MARKER,
    *ENTITY_TOPICS,
)


class CameraService:
    """A Service (`runner.py`). `analyst` makes the one that looks at frames, a new one for each scan.

    `hears`: somebody listens to the camera's alarms and posts them.
    """

    def __init__(
        self,
        config: Config,
        sender: Sender,
        analyst: Callable[[], Analyst],
        eye: Eye,
        channel: Channel | None = None,
        *,
        hears: bool = False,
    ) -> None:
        self.config = config
        self.subscribes = (*(topic.filter_for(cam=config.name) for topic in TOPICS), LOST_TOPIC)
        self.due: float | None = 0.0
        self.counters: dict[str, int] = {"requests": 0, "failed_requests": 0, "frames": 0, "failed_snapshots": 0}
        self._out: list[Message] = []
        publish = self._out.append
        self.places = Places(config.folder / config.places)
        self.health = Health(config.name)
        self.bulletin = Bulletin(config.name, self.health, self.places, publish)
        self.bulletin.diagnostics, self.bulletin.video = config.diagnostics, channel
        self.discovery = Discovery(config.name, publish, on=config.discovery)
        self.answers = Answers(config.name, publish, self.bulletin.position, config.limits.words, self.counters)
        self.early = Early(self.answers)
        self.stage = Stage(sender.submit)
        self.motors = Motors(self.stage, self.answers, self._motor_plan, self._motor_ended)
        self.abilities = Abilities(config.state and config.state / f"{config.name}-can.json", self._has_time)
        self.trips = Trips(config, self.bulletin, self.places, self.abilities)
        self.scanner = Scanner(config, self.trips.skill, eye, analyst, self.bulletin, self.places)
        self.motors.skill, self.scanner.begin = self.trips.skill, self._begin
        self.calibrator = Calibrator(config, self.trips, self.scanner, publish)
        self.feed = Feed(config, self.health, self.bulletin.facts, channel, publish)
        takes = Takes(config.name, config.folder / config.audio, publish)
        self.chores = Chores(self.trips, self.scanner, self.health, self.bulletin, self.feed, takes, self.calibrator)
        self.motion = MotionWatch(self._begin, config.motion.codes, config.motion.hold_s, on=hears)
        self.upkeep = Upkeep(config.name, config.clock, self.bulletin.facts, self._has_time)
        self._polling = False

    def handle(self, message: Message, now: float) -> Iterable[Message]:
        """Takes a reply, an analysed frame, or an order."""
        if message.topic == REPLY and isinstance(message.value, Reply):
            self._reply(message.value, now)
        elif message.topic == HEARD and isinstance(message.value, Heard):
            self.motion.take(message.value)
        elif message.topic == ANALYSED and isinstance(message.value, Analysed):
            self.scanner.take(message.value)
        elif message.topic == LOST_TOPIC:  # nobody could end a motion any more
            self.early.call_off(BROKER_LOST)
            self.motors.give_up(BROKER_LOST, now)
        elif message.topic == ASKED:
            self.stage.begin(self.feed.shown(), now, _nobody)
        else:
            try:
                read = topics.read(message, now)
            except BadMessage as error:
                self.answers.refuse(message, error)
                raise
            self._read(read, now)
        return self._flush()

    def tick(self, now: float) -> Iterable[Message]:
        """Wakes the plans, and publishes what has changed."""
        if not self._polling:
            self._polling = True
            for plan in (self._poll(now), *self.feed.lasting(now), self.upkeep.plan(now)):
                self.stage.begin(plan, now, _nobody)
        self.early.tick(now)
        self.stage.tick(now)
        self.motors.tick(now)
        self.health.moving = self.motors.busy
        self.counters |= {"frames": self.scanner.frames, "failed_snapshots": self.feed.spoilt.count}
        self.scanner.tick(now)
        self._watch_motion(now)
        self.bulletin.tick(now, self.counters)
        self.discovery.tick(self.bulletin.identity, self.places.named)
        self.due = min(time for time in (self.bulletin.due, self.stage.due, self.scanner.due) if time is not None)
        return self._flush()

    def _watch_motion(self, now: float) -> None:
        turning = self.motors.busy or self.bulletin.turning or self.scanner.modes.leaving or self.chores.changing > 0
        motion = self.motion.tick(now, turning=turning, online=self.health.online)
        if motion is not None:
            self.bulletin.say(topics.CAMERA_MOTION, motion)
            self._begin(self.feed.at_motion(motion.value), now)
        self.motion.tell(self.bulletin.facts)
        if self.abilities.present is not None:
            self.bulletin.facts.values["can"] = self.abilities.present.words
        self.bulletin.facts.values["request_queue"] = str(len(self.stage.asked))

    def _has_time(self) -> bool:
        return self.health.online and not self.health.rebooting and not self.motors.busy

    def _begin(self, plan: Plan[None], now: float) -> None:
        """A plan whose end nobody waits for."""
        self.stage.begin(plan, now, _nobody)

    def leave(self, now: float) -> Iterable[Message]:
        """The last words: what was ordered is not done any more, and what turns is stopped."""
        self.motors.give_up(ENDS, now)
        self.early.call_off(ENDS)
        self.answers.leave(ENDS)
        return self._flush()

    def close(self) -> None:
        """Ends the processes of a scan that is under way; what was learnt is on the disk then."""
        self.scanner.close()
        self.trips.kept.written()

    def _flush(self) -> list[Message]:
        out = list(self._out)
        self._out.clear()
        return out

    def _reply(self, reply: Reply, now: float) -> None:
        self.counters["requests"] += 1
        self.counters["failed_requests"] += reply.error is not None
        if reply.request.rank is not Rank.PICTURE:
            self.health.take(reply)
        if isinstance(reply.result, Reading):
            self.bulletin.take(reply.result, reply.received)
        elif isinstance(reply.result, Picture):
            old, self.scanner.picture = self.scanner.picture, reply.result
            self.feed.turned(reply.result)
            self.trips.see(reply.result, old)
        elif isinstance(reply.result, Identity):
            self.bulletin.identity = reply.result
            self.trips.meet(reply.result)
        self.stage.reply(reply, now)

    def _poll(self, now: float) -> Plan[None]:
        """Asks where the camera looks while nobody else does, and who it is after it was away."""
        while True:
            now = yield from wait(max(now + 0.05, self.health.look_at(self.bulletin.still_for(now))))
            if self.motors.busy or self.health.rebooting:
                now = yield from wait(now + BUSY_S)
                continue
            if now < self.health.look_at(self.bulletin.still_for(now)):
                continue  # it was read meanwhile, by a move that is over
            reply = yield from attempt(Status())
            now = reply.received
            self.motors.see(reply, turning=self.bulletin.turning)
            if self.health.online and not self.health.met:
                self.early.waits = True
                if self.health.meet((yield from attempt(Identify()))):
                    self.bulletin.facts.values["rebooted"] = stamp(now)
                self.stage.begin(self.abilities.meet(self.bulletin.identity, now), now, _nobody)
                now = (yield from attempt(GetPicture())).received
                self.upkeep.met()
                self.stage.begin(self.scanner.restored(), now, _nobody)
                if self.bulletin.turning:
                    self.motors.make_sure(now)
            for job, command in self.early.met(now):
                self._take(job, command, now)

    def _read(self, read: topics.Read, now: float) -> None:
        payload = read.payload
        if read.topic is topics.CAMERA_SNAPSHOT_GET:
            self._begin(self.feed.on_request(), now)
        elif read.topic in ENTITY_TOPICS:
            self.discovery.hear(read)
        elif isinstance(payload, ScanResult):
            self.scanner.remember(payload)  # also of another life of this service
        elif isinstance(payload, PositionSet):
            value = payload.model_dump(exclude={"id", "by"}, exclude_none=True)
            job = life.job("Position", value, payload.by, payload.id, read.message)
            self._take(job, LookAt(payload.pan, payload.tilt, payload.zoom), now)
        elif isinstance(payload, Order):
            job = life.job(orders.canonical(read.levels["key"]), payload.value, payload.by, payload.id, read.message)
            try:
                command = orders.read(job.key, payload.value)
            except Refused as error:
                self.answers.tell(job, "refused", str(error))
                raise BadMessage(f"{read.message.topic}: {error}") from error
            self._take(job, command, now)

    def _take(self, job: Job, command: Command, now: float) -> None:
        job.command = command
        if self.early.waits and (isinstance(command, IN_TURN) or not isinstance(command, FREE)):
            self.early.keep(job, command)
            return
        try:
            self._check(command)
        except Refused as error:
            self.answers.tell(job, "refused", str(error))
            return
        self.answers.tell(job, "accepted")
        if isinstance(command, orders.EndScan) and not self.motors.scanning:
            self.answers.tell(job, "running")
            self.answers.tell(job, "done")
        elif isinstance(command, orders.Halt | orders.EndScan):
            self.early.call_off(f"stopped by the order {job.key}")
            self.motors.halt(job, now)
        elif isinstance(command, orders.Motor):
            self.motors.order(job, now)
        else:
            if isinstance(command, VideoMode):
                self.scanner.modes.give_over()
            self.answers.tell(job, "running")
            self.stage.begin(self.chores.plan(command, now), now, lambda run, now: self._chore_ended(job, run))

    def _chore_ended(self, job: Job, run: Run) -> None:
        self.bulletin.say_changed()
        if run.error is None:
            self.answers.tell(job, "done")
        else:
            self.answers.tell(job, "refused" if isinstance(run.error, Refused) else "failed", str(run.error))

    def _check(self, command: Command) -> None:
        """Refused when it can be said before anything is sent that this cannot be done."""
        if not isinstance(command, FREE) and not self.health.online:
            raise Refused(f"the camera is {self.health.state}: {self.health.reason}")
        if isinstance(command, GotoPlace | LookAt):
            self.trips.goal(command)
        elif isinstance(command, orders.RemovePlace):
            self.places.get(command.place)
        elif isinstance(command, orders.Broadcast):
            self.feed.check(command)
        elif isinstance(command, ScanFor):
            self.scanner.check(command)

    def _motor_plan(self, command: Command, now: float) -> Plan[object]:
        if isinstance(command, ScanFor):
            return self.scanner.plan(command, now)
        if isinstance(command, orders.Calibration):
            return self.calibrator.plan(command, now)
        assert isinstance(command, GotoPlace | LookAt)
        return self.trips.plan(command, now)

    def _motor_ended(self, job: Job, state: OrderState, error: str | None, rest: Reading | None, now: float) -> None:
        self.trips.keep(job.command)
        if state == "done":
            self.bulletin.rests(rest)
        if isinstance(job.command, ScanFor):
            self.scanner.ended(state, error, now)


def _nobody(run: Run, now: float) -> None:
    """Nobody waits for the end of this plan."""

# SPDX-License-Identifier: Apache-2.0
"""The loop of a live view: takes requests, makes moments at their pace and draws them."""

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from scripts import interrupt
from scripts.live.drawn import Drawn
from scripts.live.page import CROWDS, Page
from scripts.live.playback import (
    MOST_WAITING,
    Anew,
    Drive,
    Inbox,
    OnView,
    OnWorld,
    Pace,
    Playback,
    Request,
    Seek,
    Speed,
)
from scripts.live.served import Served
from scripts.live.session import Opener
from sim.view.moment import Shown
from sim.world.requests import Kidnap, MoveDoor, Push
from slam.errors import InvalidValueError, MobiliaError
from slam.estimate import Raster
from slam.ros.link import Link, Topic
from slam.ros.node import decoded, pose_of
from slam.ros.robot import Robot

_STRING = "std_msgs/msg/String"
_OPEN = {"open": True, "shut": False}


def _drive(message: Any) -> OnWorld:
    twist = getattr(message, "twist", message)  # of a TwistStamped
    ahead, side = float(twist.linear.x), float(twist.linear.y)
    return Drive(v=ahead, omega=float(twist.angular.z), side=side)


def _carry(message: Any) -> OnWorld:
    x, y, theta = pose_of(message).pose.tolist()
    return Kidnap(pose=(x, y, theta))


def _door(message: Any) -> OnWorld:
    word, _, name = message.data.partition(" ")
    if word not in _OPEN:
        raise InvalidValueError(f"expected 'open' or 'shut' and a door's name, got {word!r:.40}")
    return MoveDoor(opened=_OPEN[word], name=name)


TAKES = (
    (Topic(name="/cmd_vel", kind="geometry_msgs/msg/Twist"), _drive),
    (Topic(name="/cmd_vel", kind="geometry_msgs/msg/TwistStamped"), _drive),  # newer stacks
    (Topic(name="/initialpose", kind="geometry_msgs/msg/PoseWithCovarianceStamped"), _carry),
    (Topic(name="/mobilia/push", kind=_STRING), lambda message: Push(name=message.data)),
    (Topic(name="/mobilia/door", kind=_STRING), _door),
    (Topic(name="/mobilia/kidnap", kind=_STRING), lambda message: Kidnap(goal=message.data)),
)


class Network:
    """One robot on ``link``."""

    def __init__(self, link: Link) -> None:
        self._link, self._robot = link, Robot(link)
        self._sent = -1
        for topic, _ in TAKES:
            link.subscribe(topic)

    def send(self, shown: Shown) -> None:
        """Publish a moment that is due; one that is looked back at is not sent again."""
        if shown.number > self._sent:
            self._sent = shown.number
            self._robot.send(shown.frame)

    def begin(self, static_map: Raster | None, height_m: float) -> None:
        """A run begins; arguments of ``Robot.restart``."""
        self._sent = -1
        self._robot.restart(static_map, height_m)

    def requests(self, refuse: Callable[[object], None]) -> Iterator[OnWorld]:
        """What others ask for, of each topic the last; ``refuse`` is told what cannot be."""
        for topic, read in TAKES:
            for taken in self._link.take(topic)[-1:]:
                try:
                    yield read(decoded(topic.kind, taken.data))
                except MobiliaError as error:
                    refuse(f"ROS 2: {topic.name}: {error}")

    def close(self) -> None:
        """Leave the network."""
        self._link.close()


IDLE_S = 0.05  # between two looks at the inbox while nothing moves
SILENCE_S = 1.0  # between two complaints: a stream of bad messages does not flood the page


class View:
    """A session as a page; everything but viser's callbacks runs in one thread.

    session  what is shown;   playback  which moment of it
    """

    def __init__(
        self, opener: Opener, address: tuple[str, int], origins: Sequence[str] = (), *,
        playing: bool = True, speed: float = 1.0, network: Network | None = None,
    ) -> None:  # fmt: skip
        self._network, self._told_s = network, -SILENCE_S
        self._opener, self._inbox, self._pace = opener, Inbox(), Pace()
        self.session = opener.open()
        self.served = Served(address, self.session.footage.title, origins)
        settings = opener.settings
        self._page = Page(
            self.served.gui, self.served.scene, self.served.controls, self._inbox,
            {
                "room": opener.path is None, "slam": opener.slams[0],
                "crowd": settings.get("crowd", CROWDS[0]),
                **{k: settings.get(k, settings.get("dynamism", 0.5)) for k in ("motion", "change")},
            },
        )  # fmt: skip
        self._begin(playing=playing, speed=speed)
        self.served.look_at(lambda: self._drawn.bounds)

    def _begin(self, *, playing: bool, speed: float) -> None:
        """Show the session from its start."""
        if self._network is not None:
            self._network.begin(self.session.static_map, self.session.scan_height_m)
        footage, scene = self.session.footage, self.served.scene
        scene.reset()
        scene.set_up_direction("+z")
        self._drawn = Drawn(scene, self.session.moments, footage.stage.world)
        self.playback = Playback(self.session.run(), playing=playing, speed=speed)
        self._due: Shown | None = None
        self._told_end = False
        self._at(Speed(factor=speed))

    def close(self) -> None:
        """Stop listening."""
        self.served.close()
        if self._network is not None:
            self._network.close()

    def turn(self) -> None:
        """Once round: what pages ask for, then the next moment when it is due."""
        interrupt.check()
        for _ in range(MOST_WAITING):  # all that wait, lest twists grow old where scans are slow
            if not self._wait(0.0):
                break
        self._tell()
        playback = self.playback
        if self._due is None and not playback.resting:
            self._from_network()
            self._due = playback.advance()
        if self._due is None:
            self._wait(IDLE_S)
            return
        shown = self._due
        if self._wait(self._wait_s(shown)) and (self._due is None or self._wait_s(shown) > 0.0):
            return  # it may have been done away with; a stream of requests does not hold it up
        self._due = None
        if self._network is not None:
            self._network.send(shown)
        if self._pace.to_send() or not playback.playing or shown.said:
            self._show(shown)

    def _show(self, shown: Shown) -> None:
        self._drawn.draw(shown)
        self._page.show(shown, self.playback, self.session)

    def _wait_s(self, due: Shown) -> float:
        playback = self.playback
        return self._pace.wait_s(due.seconds, playback.speed) if playback.playing else 0.0

    def _wait(self, seconds: float) -> bool:
        """Do a request that is there, or comes meanwhile; whether there was one."""
        request = self._inbox.get(seconds)
        if request is not None:
            self._do(request)
        return request is not None

    def _do(self, request: Request) -> None:
        try:
            if isinstance(request, OnView):
                self._at(request)
            elif isinstance(request, Anew):
                self._anew(request)
            elif isinstance(request, OnWorld):
                self._touch(request)
        except MobiliaError as error:
            self._inbox.refuse(error)

    def _at(self, request: OnView) -> None:
        self.playback.do(request)
        self.session.every = max(1.0, self.playback.speed)
        self._pace.restart()
        if isinstance(request, Seek):
            self._due = None
        if self.playback.shown is not None:
            self._show(self.playback.shown)

    def _anew(self, request: Anew) -> None:
        opener = self._opener.anew(request)
        session = opener.open()  # before anything is given up: it may be refused
        self._opener, self.session = opener, session
        self._page.restart()
        self._page.say(f"from the start: {session.footage.title} · {', '.join(opener.slams)}")
        self._begin(playing=self.playback.playing, speed=self.playback.speed)

    def _touch(self, request: OnWorld) -> None:
        """Do something to the world, which stands between two scans."""
        hands, playback = self.session.hands, self.playback
        if hands is None:
            raise InvalidValueError("this is a log: nothing in it can be moved")
        if playback.ended:
            raise InvalidValueError("the run has ended: nothing moves any more")
        if playback.looks_back:
            raise InvalidValueError("an earlier moment is shown: go back to now first")
        drove = hands.client_drives
        done = hands.do(request)
        if hands.client_drives != drove or not isinstance(request, Drive):
            self._page.say(f"you: {done}", own=True)
        if playback.shown is not None:
            self._page.show(playback.shown, playback, self.session)

    def _from_network(self) -> None:
        """Do what others on the network ask for, just before the next scan."""
        if self._network is not None:
            for request in self._network.requests(self._inbox.refuse):
                self._do(request)

    def _tell(self) -> None:
        """What was refused, and that the run has ended."""
        now_s = time.monotonic()
        if now_s - self._told_s >= SILENCE_S and (said := self._inbox.refused()) is not None:
            self._told_s = now_s
            self._page.say(said)
        if self.playback.ended and not self._told_end:
            self._told_end = True
            self._page.say(
                self.playback.why or "the run has ended; its last minute can be looked at"
            )

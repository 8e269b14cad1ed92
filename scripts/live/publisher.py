# SPDX-License-Identifier: Apache-2.0
"""Topics of the live view, and what is sent on each of them for one moment."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

from scripts.film import draw
from scripts.live.drawings import Drawings, colors_of, frames_of
from scripts.live.playback import Playback
from scripts.live.sdk import Sdk
from scripts.live.session import Session, Shown
from scripts.live.things import Things
from slam.frames import Float

PATH_POINTS = 2000  # of a path as sent
PATH_S = 1.0  # so often of the run a path is sent whole


class Publisher:
    """Sends moments to whoever is subscribed; to be used by one thread, but ``ask``.

    Topics begin with "/slam" for the first SLAM, "/odometry", and the name of any other.
    """

    def __init__(self, sdk: Sdk, session: Session) -> None:
        self._session, self._draw, self._sdk = session, Drawings(sdk), sdk
        self.context = sdk.foxglove.Context()
        self._channels: dict[str, Any] = {}
        self._things: Things | None = None
        self._height_m = 0.0
        if session.room is not None:
            world = session.room.hands.simulation.world
            self._things, self._height_m = Things(sdk, world), world.scene.scan_height_m
        names = list(session.replay.tracks)
        self._colors = colors_of(names)
        self._topics = {name: topic_of(name, session.primary) for name in names}
        self._open(names)
        self._asked: set[str] = set()
        self._lock = threading.Lock()
        self._map: Any = None
        self._path_s = 0.0
        self._last_number = -1

    def _open(self, names: list[str]) -> None:
        kinds = {
            "/tf": "FrameTransforms", "/scan": "LaserScan", "/scan/points": "PointCloud",
            "/map": "Grid", "/landmarks": "SceneUpdate", "/events": "Log",
        }  # fmt: skip
        if self._things is not None:
            kinds["/world"] = "SceneUpdate"
        kinds |= {"/truth/pose": "PoseInFrame", "/truth/drawing": "SceneUpdate"}
        kinds["/truth/points"] = "PointCloud"
        for name in names:
            topic = self._topics[name]
            kinds |= {f"{topic}/pose": "PoseInFrame", f"{topic}/drawing": "SceneUpdate"}
        for topic, kind in kinds.items():
            make = getattr(self._sdk.channels, f"{kind}Channel")
            self._channels[topic] = make(topic, context=self.context)
        for topic in ("/playback", *(f"{self._topics[name]}/errors" for name in names)):
            schema = _PLAYBACK if topic == "/playback" else _ERRORS
            self._channels[topic] = self._sdk.foxglove.Channel(
                topic, schema=schema, context=self.context
            )

    def ask(self, topic: str) -> None:
        """Somebody new listens there, and needs all of it; from any thread."""
        with self._lock:
            self._asked.add(topic)

    @property
    def asked(self) -> bool:
        """Whether anybody waits for something that was sent before."""
        with self._lock:
            return bool(self._asked)

    def send(self, shown: Shown, playback: Playback) -> None:
        """All topics that somebody listens to."""
        with self._lock:
            asked, self._asked = self._asked, set()
        stamp, drawn = self._draw.stamp(shown.stamp_ns), self._draw
        jumped = shown.number < self._last_number
        self._last_number = shown.number
        self._log("/tf", shown, partial(self._transforms, shown, stamp))
        if shown.frame.scan is not None:
            self._log("/scan", shown, partial(drawn.scan, stamp, shown.frame.scan))
        self._log("/scan/points", shown, partial(drawn.points, stamp, "laser", shown.frame))
        if shown.truth_map is not None:
            points = partial(drawn.points, stamp, "truth_laser", shown.frame)
            self._log("/truth/points", shown, points)
        self._room(shown, stamp, everything=jumped or "/world" in asked)
        self._maps(shown, stamp, bool(asked & {"/map", "/landmarks"}))
        self._tracks(shown, stamp, jumped or any(topic.endswith("/drawing") for topic in asked))
        for said in shown.said:
            self._log("/events", shown, partial(drawn.log, stamp, said.level, said.text))
        self._log("/playback", shown, partial(_state, shown, playback, self._session))

    def _transforms(self, shown: Shown, stamp: Any) -> Any:
        estimate = shown.estimates[self._session.primary]
        tree = frames_of(
            shown.T_world_map, estimate.T_map_robot, shown.frame, shown.truth_map, self._height_m
        )
        return self._draw.transforms(stamp, tree)

    def _log(self, topic: str, shown: Shown, make: Callable[[], Any]) -> None:
        channel = self._channels[topic]
        if channel.has_sinks():
            channel.log(make(), log_time=shown.stamp_ns)

    def _room(self, shown: Shown, stamp: Any, *, everything: bool) -> None:
        things, placed = self._things, shown.placed
        if things is None or placed is None or not self._channels["/world"].has_sinks():
            return
        entities = things.entities(placed, stamp, everything=everything)
        if entities:
            update = self._sdk.messages.SceneUpdate(entities=entities)
            self._channels["/world"].log(update, log_time=shown.stamp_ns)

    def _maps(self, shown: Shown, stamp: Any, asked: bool) -> None:
        now = (shown.raster, shown.landmarks)
        if self._map == now and not asked:
            return
        self._map = now
        raster, landmarks = now
        if raster is not None:
            self._log("/map", shown, partial(self._draw.grid, stamp, raster))
        if landmarks is not None:
            self._log("/landmarks", shown, partial(self._draw.landmarks, stamp, landmarks))

    def _tracks(self, shown: Shown, stamp: Any, whole: bool) -> None:
        whole = whole or abs(shown.seconds - self._path_s) >= PATH_S
        if whole:
            self._path_s = shown.seconds
        for name, estimate in shown.estimates.items():
            topic, pose = self._topics[name], estimate.T_map_robot
            self._pose(shown, stamp, topic, pose)
            self._log(f"{topic}/errors", shown, partial(shown.errors, name))
            path, covariance = self._path(name, shown, whole), estimate.covariance
            make = partial(self._draw.track, stamp, pose, covariance, path, self._colors[name])
            self._log(f"{topic}/drawing", shown, make)
        if shown.truth_map is not None:
            self._pose(shown, stamp, "/truth", shown.truth_map)
            path = self._path("truth", shown, whole)
            make = partial(self._draw.track, stamp, shown.truth_map, None, path, draw.GREEN)
            self._log("/truth/drawing", shown, make)

    def _pose(self, shown: Shown, stamp: Any, topic: str, pose: Float) -> None:
        self._log(f"{topic}/pose", shown, partial(self._draw.in_frame, stamp, "map", pose))

    def _path(self, name: str, shown: Shown, whole: bool) -> Float | None:
        return self._session.paths[name].until(shown.number, PATH_POINTS) if whole else None


def topic_of(name: str, primary: str) -> str:
    """Where a track's topics begin."""
    if name == "odometry":
        return "/odometry"
    if name == primary:
        return "/slam"
    return "/" + "".join(c if c.isalnum() or c in "-_" else "_" for c in name)


def _state(shown: Shown, playback: Playback, session: Session) -> dict[str, Any]:
    present = playback.present
    if session.room is None:
        driver = "log"
    else:
        driver = "client" if session.room.hands.client_drives else "tour"
    return {
        "time_s": shown.seconds,
        "present_s": shown.seconds if present is None else present.seconds,
        "playing": playback.playing,
        "ended": playback.ended,
        "speed": playback.speed,
        "driver": driver,
        "slam": session.primary,
        "converged": shown.estimates[session.primary].converged,
    }


_NUMBER = {"type": "number"}
_ERRORS = {
    "title": "mobilia.Errors", "type": "object",
    "properties": {
        "position_m": _NUMBER, "heading_deg": _NUMBER, "position_2_sigma_m": _NUMBER,
        "heading_2_sigma_deg": _NUMBER,
    },
}  # fmt: skip
_PLAYBACK = {
    "title": "mobilia.Playback", "type": "object",
    "properties": {
        "time_s": _NUMBER, "present_s": _NUMBER, "playing": {"type": "boolean"},
        "ended": {"type": "boolean"}, "speed": _NUMBER, "driver": {"type": "string"},
        "slam": {"type": "string"}, "converged": {"type": "boolean"},
    },
}  # fmt: skip

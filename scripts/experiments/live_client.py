# SPDX-License-Identifier: Apache-2.0
"""A client of the live view: drives the robot, pushes a chair, prints what the server sent.

``python -m scripts.experiments.live_client --out live_client.png`` starts ``mobilia live`` on a
free port, speaks to it over a real WebSocket, and draws the messages that it decoded; it reads
nothing else. Needs the extra ``live`` and ``websockets``.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from scripts.figures import COLORS, styled
from scripts.live.client import Client, fields, position
from slam import se2
from slam.errors import MobiliaError
from slam.files import replacing
from slam.frames import Float

TOPICS = ("/playback", "/world", "/truth/pose", "/slam/pose", "/slam/errors", "/truth/points",
          "/events", "/tf")  # fmt: skip
SPEED, TURN = 0.5, 0.35  # m/s, rad/s: of the twists
TWISTS, SCANS = 40, 4  # how many are sent, and scans between two
PUSH_SCANS = 75  # that a chair has to roll
PUSH_MPS = 1.5
CHANNEL = 1  # of what this client publishes
LABELS = {1: "static", 2: "can move but rests", 3: "moves", 4: "mixed pixel", 255: "not known"}
LABEL_COLORS = {1: "#7a3fb0", 2: "#1f61be", 3: "#ce2c3c", 4: "#de6e18", 255: "#b0b0b0"}
WALL_M = 1.0  # a box of the room that is higher is drawn dark
CUBES, CYLINDERS = 8, 10  # fields of foxglove.SceneEntity


class Seen:
    """What came over the socket, scan by scan.

    paths  topic -> (x, y) m in the map
    """

    def __init__(self, client: Client) -> None:
        self.client = client
        self.paths: dict[str, list[tuple[float, float]]] = {"/truth/pose": [], "/slam/pose": []}
        self.period_s = 0.0  # between two scans

    def note(self) -> None:
        """Keep the newest."""
        for topic, path in self.paths.items():
            if topic in self.client.newest:
                path.append(self.client.pose(topic))

    def step(self, scans: int) -> None:
        """Let the world go on by as many scans."""
        client, before = self.client, self.client.playback()["time_s"]
        client.call("/step", scans=scans)
        then = before + (scans - 0.5) * self.period_s
        client.until(lambda: client.playback()["time_s"] > then)
        self.period_s = self.period_s or client.playback()["time_s"] - before
        self.note()


@contextmanager
def served(scene: str, dynamism: float, seed: int) -> Iterator[str]:
    """The address of a ``mobilia live`` of its own, which ends with this."""
    words = [sys.executable, "-m", "scripts", "live", scene, "--slam", "shunting", "--port", "0"]
    words += ["--paused", "--dynamism", f"{dynamism:g}", "--seed", str(seed)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            lines = (re.search(r"ws://[\w.:]+\d", line) for line in process.stdout)
            found = next((line[0] for line in lines if line), None)
            if found is None:
                raise MobiliaError(f"mobilia live ended with status {process.wait()}")
            yield found
        finally:
            process.terminate()
            process.wait()


def drive(seen: Seen) -> None:
    """Twists on ``/cmd_vel``: an arc to the left."""
    client = seen.client
    channel = {"id": CHANNEL, "topic": "/cmd_vel", "encoding": "json", "schemaName": "Twist"}
    client.send(op="advertise", channels=[channel])
    twist = json.dumps({"linear": {"x": SPEED}, "angular": {"z": TURN}}).encode()
    for _ in range(TWISTS):
        client.publish(CHANNEL, twist)
        seen.step(SCANS)


def push(seen: Seen) -> tuple[str, list[Float], list[Float]]:
    """The chair nearest to the robot, away from it: its name, its boxes before and after."""
    client = seen.client
    T_world_robot = se2.compose(transform(client, "world", "map"), pose_of(client, "/truth/pose"))
    chairs = [name for name in client.entities if name.startswith("mover/chair")]
    away = {name: np.subtract(client.middle(name), T_world_robot[:2]) for name in chairs}
    name = min(chairs, key=lambda chair: float(np.hypot(*away[chair])))
    before = outlines(client.entities[name])
    x, y = client.middle(name)
    heading_deg = round(math.degrees(math.atan2(away[name][1], away[name][0])), 1)
    said = client.call(
        "/push", name=name.partition("/")[2], speed_mps=PUSH_MPS, heading_deg=heading_deg
    )
    print(f"/push: {said}")
    seen.step(PUSH_SCANS)
    now = client.middle(name)
    print(f"{name}: ({x:.2f}, {y:.2f}) m before, ({now[0]:.2f}, {now[1]:.2f}) m after, "
          f"{math.hypot(now[0] - x, now[1] - y):.2f} m moved")  # fmt: skip
    return name, before, outlines(client.entities[name])


def pose_of(client: Client, topic: str) -> Float:
    """x m, y m, theta rad of a ``PoseInFrame``."""
    return _pose(fields(client.newest[topic])[3][0])


def _pose(data: bytes) -> Float:
    """Of a ``Pose``: its place and its turn about z."""
    turn = fields(fields(data)[2][0])
    qz, qw = turn.get(3, [0.0])[0], turn.get(4, [0.0])[0]
    return np.array([*position(data), 2.0 * math.atan2(qz, qw)])


def transform(client: Client, parent: str, child: str) -> Float:
    """Of ``/tf``."""
    for part in fields(client.newest["/tf"])[1]:
        found = fields(part)
        if (found[2][0], found[3][0]) == (parent.encode(), child.encode()):
            place, turn = fields(found[4][0]), fields(found[5][0])
            qz, qw = turn.get(3, [0.0])[0], turn.get(4, [0.0])[0]
            x, y = (place.get(k, [0.0])[0] for k in (1, 2))
            return np.array([x, y, 2.0 * math.atan2(qz, qw)])
    raise MobiliaError(f"/tf has no {parent} -> {child}")


def outlines(entity: dict[int, list[Any]]) -> list[Float]:
    """(4, 2) corners, m, of each cube of an entity as seen from above."""
    found = []
    for data in entity.get(CUBES, []):
        part = fields(data)
        size = fields(part[2][0])
        half = np.array([size.get(1, [0.0])[0], size.get(2, [0.0])[0]]) / 2.0
        corners = half * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
        found.append(se2.transform(_pose(part[1][0]), corners))
    return found


def heights(entity: dict[int, list[Any]]) -> list[float]:
    """m, of each cube of an entity."""
    return [fields(fields(data)[2][0]).get(3, [0.0])[0] for data in entity.get(CUBES, [])]


def points(client: Client) -> tuple[Float, NDArray[np.uint8]]:
    """(n, 2) ends of the beams in the world, m, and (n,) what each hit."""
    cloud = fields(client.newest["/truth/points"])
    (stride,) = cloud[4]
    rows = np.frombuffer(cloud[6][0], np.uint8).reshape(-1, stride)
    offset = {
        fields(part)[1][0].decode(): fields(part).get(2, [0])[0] for part in cloud[5]
    }  # of each field of a point, bytes
    xy = np.column_stack([rows[:, offset[a] : offset[a] + 4].copy().view("<f4") for a in "xy"])
    T_world_map, T_map_truth = transform(client, "world", "map"), transform(client, "map", "truth")
    T_world_truth = se2.compose(T_world_map, T_map_truth)
    T_world_laser = se2.compose(T_world_truth, transform(client, "truth", "truth_laser"))
    return se2.transform(T_world_laser, xy.astype(np.float64)), rows[:, offset["label"]]


def report(seen: Seen, start_s: float) -> None:
    """The decoded messages, in words."""
    client = seen.client
    print(f"server: {client.info['name']}, {', '.join(client.info['capabilities'])}")
    for channel in sorted(client.channels.values(), key=lambda c: str(c["topic"])):
        print(f"  {channel['topic']}: {channel['schemaName']}, {channel['encoding']}")
    state = client.playback()
    print(f"/playback: {start_s:.2f} s to {state['time_s']:.2f} s, driver {state['driver']}")
    for topic, path in seen.paths.items():
        way = float(np.hypot(*np.diff(path, axis=0).T).sum())
        x, y = path[-1]
        print(f"{topic}: {way:.2f} m driven, last at ({x:.3f}, {y:.3f}) m in the map")
    print(f"/slam/errors: {client.newest['/slam/errors'].decode()}")
    _, label = points(client)
    counts = Counter(label.tolist())
    words = ", ".join(f"{n} {LABELS[what]}" for what, n in sorted(counts.items()))
    print(f"/truth/points: {len(label)} points: {words}")
    for said in client.events:
        print(f"/events: {said}")


@styled({"axes.grid": False})
def draw(seen: Seen, chair: tuple[str, list[Float], list[Float]], out: Path) -> None:
    """The room, the robot's way, the chair and the scan, from the messages only."""
    figure = Figure(figsize=(8.0, 5.0))
    axes = figure.add_subplot()
    client, (name, before, after) = seen.client, chair
    room = client.entities["room"]
    boxes, high = outlines(room), heights(room)
    for k in np.argsort(high, kind="stable").tolist():  # walls over floors
        _boxes(axes, [boxes[k]], "#3b3f46" if high[k] > WALL_M else "#e4e2dc", alpha=1.0)
    for other, entity in client.entities.items():
        if other not in ("room", name):
            _boxes(axes, outlines(entity), "#9bb0c4", alpha=0.9)
    _boxes(axes, before, "#de6e18", alpha=0.35, label=f"{name.partition('/')[2]} before the push")
    _boxes(axes, after, "#de6e18", alpha=1.0, label="after it")
    at, label = points(client)
    for what in sorted(set(label.tolist())):
        here = at[label == what]
        axes.plot(*here.T, ".", ms=3.0, color=LABEL_COLORS[what], label=f"beam: {LABELS[what]}")
    T_world_map = transform(client, "world", "map")
    for topic, key in (("/truth/pose", "truth"), ("/slam/pose", "shunting")):
        way = se2.transform(T_world_map, np.array(seen.paths[topic]))
        dashes = "-" if key == "truth" else "--"
        axes.plot(*way.T, dashes, color=COLORS[key], lw=2.0, label=topic)
    end = se2.transform(T_world_map, np.array(seen.paths["/truth/pose"][-1:]))
    axes.plot(*end.T, "o", color=COLORS["truth"], ms=9)
    axes.set(aspect="equal", xlabel="x in m", ylabel="y in m")
    axes.set_title("What a client received: it drove an arc and pushed the nearest chair")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    FigureCanvasAgg(figure)
    with replacing(out) as part:
        figure.savefig(part, format="png", dpi=110)


def _boxes(axes: Axes, boxes: list[Float], color: str, *, alpha: float, label: str = "") -> None:
    for k, corners in enumerate(boxes):
        words = label if k == 0 else ""
        axes.add_patch(Polygon(corners, facecolor=color, alpha=alpha, label=words or None))


def main(arguments: list[str] | None = None) -> None:
    """Drive, push, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="arena")
    parser.add_argument("--dynamism", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="picture to write")
    given = parser.parse_args(arguments)
    with served(given.scene, given.dynamism, given.seed) as url, Client.of(url) as client:
        client.subscribe(*TOPICS)
        client.call("/step")
        needed = ("/truth/pose", "/slam/pose", "/world", "/tf")
        client.until(lambda: client.playback() and all(t in client.newest for t in needed))
        seen = Seen(client)
        seen.step(1)
        start_s = client.playback()["time_s"]
        drive(seen)
        chair = push(seen)
        report(seen, start_s)
        if given.out:
            draw(seen, chair, given.out)


if __name__ == "__main__":
    main()

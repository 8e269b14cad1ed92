# SPDX-License-Identifier: Apache-2.0
"""Victoria Park with known data association: the pose-landmark graph of iSAM (M. Kaess).

    graph_known_association.txt   plain, .gz or .xz; lines
    ODOMETRY i j dx dy dtheta + 6 numbers of noise      pose i -> pose j, m, rad
    LANDMARK i j dx dy sxx sxy syy                      landmark j seen from pose i, m, m^2

Poses are the rear axle's. The file has no times: ``stamped`` finds them by the distance driven,
which is the same encoder's. Where the truck stands the time is undecided, and so does not matter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slam import se2
from slam.errors import LogFormatError
from slam.frames import Float, Frame
from slam.landmarks.filter import EkfFilter
from slam.logs.text import about, number, numbered_lines
from slam.logs.victoria_park import LASER_AHEAD_M, LASER_LEFT_M
from slam.posegraph import Edge, optimise
from slam.trajectory import Trajectory

NAMES = tuple("graph_known_association.txt" + packed for packed in ("", ".xz", ".gz"))
ODOMETRY_INFORMATION = np.diag([1e4, 1e4, 2.5e5])  # 1e-4 m^2, 1e-4 m^2, 4e-6 rad^2
T_REAR_LASER = np.array([LASER_AHEAD_M, LASER_LEFT_M, 0.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Graph:
    """``poses`` (n, 3) of the rear axle, ``landmarks`` (m, 2), in the frame of the first pose;
    ``edges`` over poses, then landmarks."""

    poses: Float
    landmarks: Float
    edges: list[Edge]

    def filtered(self) -> "Graph":
        """The poses of an EKF along the graph: least squares from dead reckoning finds another
        minimum, 100 m off."""
        n = len(self.poses)
        seen: dict[int, list[Edge]] = {}
        for edge in self.edges:
            if edge.b >= n:
                seen.setdefault(edge.a, []).append(edge)
        steps = {edge.b: edge for edge in self.edges if edge.b < n}
        state, poses = EkfFilter(), []
        which: dict[int, int] = {}
        for k in range(n):
            if k:
                state.predict(steps[k].T_a_b, np.linalg.inv(steps[k].information))
            _look(state, which, seen.get(k, []))
            poses.append(state.pose.copy())
        landmarks = self.landmarks.copy()
        for node, at in which.items():
            landmarks[node - n] = state.landmarks[at]
        return Graph(poses=np.array(poses), landmarks=landmarks, edges=self.edges)

    def optimised(self) -> "Graph":
        """Least squares over all edges; observations of landmarks may be let go of."""
        start = self.filtered()
        nodes = np.concatenate([start.poses, np.pad(start.landmarks, ((0, 0), (0, 1)))])
        found, _ = optimise(nodes, self.edges)
        n = len(self.poses)
        return Graph(poses=found[:n], landmarks=found[n:, :2], edges=self.edges)

    def laser_poses(self) -> Float:
        """(n, 3) of the laser, in the frame of its first pose."""
        first = se2.inverse(se2.compose(self.poses[0], T_REAR_LASER))
        return np.array([se2.compose(first, se2.compose(p, T_REAR_LASER)) for p in self.poses])

    def landmarks_laser(self) -> Float:
        """(m, 2) m in the frame of the laser's first pose."""
        return se2.transform(se2.inverse(se2.compose(self.poses[0], T_REAR_LASER)), self.landmarks)


def _look(state: EkfFilter, which: dict[int, int], edges: list[Edge]) -> None:
    for edge in edges:
        point = edge.T_a_b[None, :2]
        spread = np.asarray(np.linalg.inv(edge.information[:2, :2])[None], dtype=np.float64)
        if edge.b in which:
            state.update([which[edge.b]], point, spread)
        else:
            which[edge.b] = int(state.add(point, spread)[0])


def read_graph(path: str | Path) -> Graph:
    """The graph as its odometry chains it, landmarks where each was first seen.

    ``path`` is the dataset's folder or the file. Raises ``LogFormatError`` with the line.
    """
    given = Path(path)
    file = given
    if given.is_dir():
        there = [given / name for name in NAMES if (given / name).is_file()]
        if not there:
            raise LogFormatError(given, f"no {NAMES[0]} here")
        file = there[0]
    index: dict[str, int] = {}
    poses: list[Float] = [np.zeros(3)]
    seen: list[tuple[str, str, list[float], int]] = []
    edges: list[Edge] = []
    for at, line in numbered_lines(file):
        with about(file, "no edge", at):
            kind, i, j, numbers = _edge(line)
            if kind == "LANDMARK":
                seen.append((i, j, numbers, at))
                continue
            if not poses[1:]:
                index[i] = 0
            if i not in index:
                raise ValueError(f"i: expected a pose that is there, got {i[:40]!r}")
            step = np.array(numbers)
            edges.append(
                Edge(a=index[i], b=len(poses), T_a_b=step, information=ODOMETRY_INFORMATION)
            )
            index[j] = len(poses)
            poses.append(se2.compose(poses[index[i]], step))
    return _with_landmarks(file, index, np.array(poses), edges, seen)


def _edge(line: str) -> tuple[str, str, str, list[float]]:
    """ODOMETRY or LANDMARK, the names of its two ends, its numbers but the noise of odometry."""
    words = line.split()
    kind = words[0] if words else ""
    if len(words) != {"ODOMETRY": 12, "LANDMARK": 8}.get(kind):
        raise ValueError(
            f"expected ODOMETRY i j and 9 numbers, or LANDMARK i j and 5 numbers, got {line[:80]!r}"
        )
    names = "dx dy dtheta" if kind == "ODOMETRY" else "dx dy sxx sxy syy"
    return kind, words[1], words[2], list(map(number, words[3:], names.split()))


def _with_landmarks(
    file: Path,
    index: dict[str, int],
    poses: Float,
    edges: list[Edge],
    seen: Sequence[tuple[str, str, list[float], int]],
) -> Graph:
    landmarks: dict[str, int] = {}
    places: list[Float] = []
    for i, j, (dx, dy, sxx, sxy, syy), at in seen:
        if i not in index or j in index:
            raise LogFormatError(file, f"pose {i} or landmark {j} is not one", at)
        if not (sxx > 0.0 and syy > 0.0 and sxx * syy > sxy * sxy):
            why = f"sxx, sxy, syy: expected a covariance, got {sxx:g}, {sxy:g}, {syy:g}"
            raise LogFormatError(file, why, at)
        pose = poses[index[i]]
        if j not in landmarks:
            landmarks[j] = len(poses) + len(places)
            places.append(se2.transform(pose, np.array([dx, dy])))
        information = np.zeros((3, 3))  # a landmark has no heading
        information[:2, :2] = np.linalg.inv([[sxx, sxy], [sxy, syy]])
        edges.append(
            Edge(
                a=index[i],
                b=landmarks[j],
                T_a_b=np.array([dx, dy, 0.0]),
                information=information,
                robust=True,
            )
        )
    return Graph(poses=poses, landmarks=np.array(places).reshape(-1, 2), edges=edges)


def stamped(graph: Graph, frames: Sequence[Frame]) -> Trajectory:
    """The laser's poses at the frames' stamps, by the distance the rear axle has driven."""
    steps = np.diff(graph.poses[:, :2], axis=0)
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
    rear = np.array(
        [
            se2.compose(frame.odometry.T_odom_robot, se2.inverse(T_REAR_LASER))[:2]
            for frame in frames
        ]
    )
    steps = np.diff(rear, axis=0)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
    place = np.interp(along, driven, np.arange(len(driven)))
    poses = graph.laser_poses()
    low = np.minimum(place.astype(np.int64), len(poses) - 2)
    out = [
        se2.interpolate(poses[k], poses[k + 1], float(p - k))
        for k, p in zip(low.tolist(), place.tolist(), strict=True)
    ]
    stamps = np.array([frame.stamp_ns for frame in frames], dtype=np.int64)
    return Trajectory(stamps_ns=stamps, poses=np.array(out))

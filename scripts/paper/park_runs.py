# SPDX-License-Identifier: Apache-2.0
"""Section 4.1: one SLAM over Victoria Park, and the graph of known associations."""

from pathlib import Path
from typing import Any

import numpy as np

from scripts.paper.census import landmarks_of
from scripts.paper.runs import map_arrays, save_run
from slam import create
from slam.errors import InvalidValueError
from slam.frames import Frame
from slam.logs import victoria_graph
from slam.logs.victoria_park import GpsTrack, read_gps, read_victoria_park
from slam.replay import Track

EVERY = 25  # scans between two looks at which landmarks there are
SHUNTING: dict[str, Any] = {
    "cell_m": 0.3, "range_m": 30.0, "carried_per_h": 0.0, "reward": 1.5, "trace_s": 10.0,
}  # fmt: skip
SYSTEMS: dict[str, tuple[str, dict[str, Any]]] = {
    "odometry": ("odometry", {}),
    "EKF": ("ekf", {"preset": "victoria_park"}),
    "shunting": ("shunting-features", SHUNTING),
    "shunting, paper preset": (
        "shunting-features",
        {"config": "paper", "cell_m": 0.3, "range_m": 30.0},
    ),
}


def read(data: str, scans: int) -> tuple[list[Frame], GpsTrack]:
    """The first ``scans`` of the drive (0: all) and the GPS fixes during them."""
    frames = list(read_victoria_park(data))[: scans or None]
    gps = read_gps(data)
    within = (gps.stamps_ns >= frames[0].stamp_ns) & (gps.stamps_ns <= frames[-1].stamp_ns)
    if within.sum() < 10:
        raise InvalidValueError(f"{data} has fewer than 10 GPS fixes during the drive")
    return frames, GpsTrack(stamps_ns=gps.stamps_ns[within], points=gps.points[within])


def run_graph(path: Path, *, data: str, scans: int) -> None:
    """Optimise the graph of known associations once."""
    frames, _ = read(data, scans)
    graph = victoria_graph.read_graph(data).optimised()
    track = victoria_graph.stamped(graph, frames)
    arrays = {"poses": track.poses, "stamps": track.stamps_ns, "found": graph.landmarks_laser()}
    save_run(path, {"sizes": [len(graph.landmarks)]}, arrays)


def run_one(path: Path, *, name: str, data: str, scans: int) -> None:
    """One SLAM over the drive; which landmarks it had at times, its map."""
    frames, _ = read(data, scans)
    kind, options = SYSTEMS[name]
    system = create(kind, **options)
    track = Track(name=name, system=system)
    stops, sizes = [], []
    found, names = [np.zeros((0, 2))], [np.zeros(0, dtype=np.int64)]
    for k, frame in enumerate(frames):
        track.take(frame.without_truth())
        if name != "odometry" and (k % EVERY == 0 or k == len(frames) - 1):
            points, called = landmarks_of(system)
            found.append(points)
            names.append(called)
            stops.append(k)
            sizes.append(len(points))
    online, final = track.online(), track.final()
    arrays: dict[str, Any] = {
        "poses": online.poses,
        "stamps": online.stamps_ns,
        "found": np.concatenate(found),
        "names": np.concatenate(names),
        "stops": np.array(stops, dtype=np.int64),
    }
    if final is not None:
        arrays["final"] = final.poses
    arrays |= map_arrays(track)
    lost = sum(not e.converged for e in track.estimates)
    ms = float(np.median(track.durations_s)) * 1e3
    save_run(path, {"sizes": sizes, "not converged": lost, "ms": ms}, arrays)

# SPDX-License-Identifier: Apache-2.0
"""What the golden test holds: a digest of every kind of result, and a few numbers beside it.

What moves there moves as in world 1, without a crowd or change out of sight, but for ``CROWDED``.

``python -m tests.golden.digests`` prints how today's results differ from ``golden.json``;
``--write`` records them anew; ``--only WORD`` looks at those whose name holds the word. A change of
code that moves things must leave the file alone. A change that moves a number writes it in a commit
of its own, which says which figure moved.

A digest holds every bit, so it is promised only on the same versions, for SLAMs on x86-64-v3. The
numbers beside it (end poses and the like) are compared everywhere, to ``TOLERANCE``.
"""

import argparse
import csv
import hashlib
import itertools
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from scripts.comparison.make import carry_out
from scripts.comparison.plan import Plan
from scripts.film.footage import of_simulation, title_of
from sim.core.dynamism import Dynamism
from sim.recording.episode import record
from sim.recording.recipe import RECIPE, Recipe, made_with, read_recipe
from sim.recording.sums import read_sums
from sim.simulation import Simulation, stream
from slam import Estimate, create, se2
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.frames import Frame
from slam.logs import open_log
from tests.pictures import pictures_at

FILE = Path(__file__).with_name("golden.json")
TOLERANCE = 1e-6  # m and rad: beyond rounding, below anything that a figure shows
OF_THE_MACHINE = (
    "ms_per_scan_p50",
    "ms_per_scan_p99",
    "ms_per_scan_p999",
    "peak_memory_mb",
)  # columns of runs.csv
LATER = ("error_tracking_m", "silent_share")  # columns that are younger than the digests
WORLD_1: dict[str, Any] = {"change": 0.0, "options": {"crowd": "none"}}  # of a recipe
CROWDED = (("0.5 of world 2", 0.5),)  # rows of this world, with its crowd
Golden = dict[str, Any]
Seen = tuple[Frame, Estimate]


class Missing(Exception):
    """What a digest is made of is not on this machine."""


class _Digest:
    """SHA-256 over arrays and words, their types and shapes among them."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, *values: Any) -> None:
        for value in values:
            if isinstance(value, str | int | bool) or value is None:
                self._hash.update(repr(value).encode())
                continue
            array = np.ascontiguousarray(value)
            self._hash.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())

    def hex(self) -> str:
        return self._hash.hexdigest()


def frames_of(scene: str, dynamism: float | Dynamism) -> Golden:
    """Scans, labels, odometry and truth of 3 s."""
    digest, last = _Digest(), None
    for frame in stream(scene, seed=7, dynamism=dynamism, seconds=3.0, labels=True):
        digest.add(frame.stamp_ns, frame.truth, frame.odometry.T_odom_robot)
        digest.add(frame.odometry.increment_covariance, frame.odometry.twist)
        if frame.scan is not None:
            digest.add(frame.scan.ranges, frame.scan.intensities)
        if frame.labels is not None:
            labels = frame.labels
            digest.add(labels.body, labels.kind, labels.displacement, labels.incidence)
            digest.add(labels.mixed)
        last = frame
    assert last is not None
    return {"sha256": digest.hex(), "end": _numbers(last.truth)}


def estimates_of(
    frames: Iterable[Frame], name: str, seen: list[Seen] | None = None, **options: Any
) -> Golden:
    """Estimates, covariances, final trajectory and map of a SLAM; ``seen`` gets each of them."""
    system, digest, estimate = create(name, **options), _Digest(), None
    for frame in frames:
        estimate = system.update(frame.without_truth())
        if seen is not None:
            seen.append((frame, estimate))
        digest.add(estimate.T_map_robot, estimate.covariance, estimate.converged)
    assert estimate is not None
    final, raster = system.trajectory(), system.map()
    digest.add(final.stamps_ns, final.poses)
    if raster is not None:
        digest.add(raster.values, raster.T_map_origin)
    return {
        "sha256": digest.hex(),
        "end": _numbers(estimate.T_map_robot),
        "end_covariance": _numbers(estimate.covariance),
        "end_final": _numbers(final.poses[-1]),
    }


def on_room(scene: str, name: str, **options: Any) -> Golden:
    """On 6 s of a simulated room as it was at dynamism 0.5 of world 1."""
    rates = Dynamism.world_1(0.5)
    return estimates_of(stream(scene, seed=11, dynamism=rates, seconds=6.0), name, **options)


def on_kidnap() -> Golden:
    """On 8 s of a tour and back at its start, unknown to the wheels: lost, found."""
    rates = Dynamism.world_1(0.25)
    there = list(stream("office", seed=11, dynamism=rates, seconds=8.0))[::2]
    step = there[1].stamp_ns - there[0].stamp_ns
    frames, last = list(there), there[-1]
    for k, frame in enumerate(there, 1):
        stamp_ns = last.stamp_ns + k * step
        assert frame.scan is not None
        frames.append(
            replace(
                last,
                stamp_ns=stamp_ns,
                odometry=replace(frame.odometry, stamp_ns=stamp_ns, T_odom_robot=se2.compose(
                    last.odometry.T_odom_robot,
                    se2.between(there[0].odometry.T_odom_robot, frame.odometry.T_odom_robot),
                )),
                scan=replace(frame.scan, stamp_ns=stamp_ns),
            )
        )  # fmt: skip
    return estimates_of(frames, "shunting")


def on_points(name: str, **options: Any) -> Golden:
    """On 60 steps of point features, a quarter of them moving."""
    world = PointWorld(PointWorldConfig(moving=0.25, n_steps=60), seed=3)
    return estimates_of(world.stream(), name, **options)


@cache
def on_intel(name: str, scans: int) -> tuple[Golden, list[Seen]]:
    """On a real log; beside the digest all that was estimated, for a test of how good it is."""
    root = os.environ.get("MOBILIA_DATA")
    data = Path(root) if root else Path(__file__).resolve().parents[3] / "shared" / "data"
    log = data / "intel" / "intel-corrected.log.xz"
    if not log.exists():
        raise Missing(f"NO REAL LOGS: {log} is missing (set MOBILIA_DATA to their folder)")
    seen: list[Seen] = []
    return estimates_of(itertools.islice(open_log(log), scans), name, seen), seen


def episode() -> Golden:
    """The messages of a generated episode and its other files, but for its recipe, which names this
    machine, and what holds the episode's name."""
    with tempfile.TemporaryDirectory() as folder:
        recipe = Recipe(scene="office", seed=5, dynamism=0.5, seconds=1.0, **WORLD_1)
        record(recipe, Path(folder))
        sums = read_sums(Path(folder) / recipe.name)
        made = read_recipe(Path(folder) / recipe.name / RECIPE)
    kept = ("map.pgm", "map.yaml", "relations.txt", "trajectory.tum")
    messages = {"messages": str(made.result["messages_sha256"])}
    return {"sha256": {name: sums[name] for name in kept} | messages}


def compared() -> Golden:
    """``runs.csv`` of a small comparison without what the machine decides, and its statistics."""
    plan = Plan(
        slams=("shunting", "occupancy", "ekf", "odometry"), scenes=("arena",), levels=(0.0, 1.0),
        seeds=(7,), seconds=2.0, change=0.0, crowd="none",
    )  # fmt: skip
    digest = _Digest()
    with tempfile.TemporaryDirectory() as folder:
        carry_out(plan, Path(folder))
        with (Path(folder) / "runs.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
        left_out = (*OF_THE_MACHINE, *LATER)
        for row in rows:
            digest.add(*(f"{k}={v}" for k, v in sorted(row.items()) if k not in left_out))
        for name in ("levels.csv", "paired.csv"):
            lines = (Path(folder) / name).read_text().splitlines()
            digest.add(*(s for s in lines if not any(word in s for word in left_out)))
    errors = [float(row["ate_unaligned_m"]) for row in rows]
    return {"sha256": digest.hex(), "ate_unaligned_m": _numbers(errors)}


def film() -> Golden:
    """Two film frames without OpenGL."""
    simulation = Simulation("arena", seed=3, dynamism=Dynamism.world_1(1.0), labels=True)
    title = title_of({"scene": "arena", "dynamism": 1.0, "seed": 3})
    footage = of_simulation(simulation, seconds=2.0, title=title, view=None)
    digest = _Digest()
    pictures = pictures_at(footage.stream, footage.show(["shunting"]), [0.5, 1.5], whole=True)
    digest.add(*pictures)
    return {"sha256": digest.hex(), "grey": [round(float(p.mean())) for p in pictures]}


def _numbers(values: Any) -> list[float]:
    return [float(value) for value in np.asarray(values, dtype=np.float64).ravel()]


MAKERS: dict[str, Callable[[], Golden]] = {
    **{
        f"frames/{scene}/{name}": lambda scene=scene, rates=rates: frames_of(scene, rates)
        for scene in ("arena", "office")
        for name, rates in (("0.0", 0.0), ("1.0", Dynamism.world_1(1.0)), *CROWDED)
    },
    **{
        f"estimates/{scene}/{title}": lambda scene=scene, name=name, o=o: on_room(scene, name, **o)
        for scene in ("arena", "office")
        for title, name, o in (
            ("shunting", "shunting", {}),
            ("shunting-paper", "shunting", {"config": "paper"}),
            ("occupancy", "occupancy", {}),
            ("ekf", "ekf", {}),
            ("shunting-features", "shunting-features", {}),
        )
    },
    "estimates/kidnap/shunting": on_kidnap,
    "estimates/points/shunting": lambda: on_points("shunting"),
    "estimates/points/shunting-features-paper": lambda: on_points(
        "shunting-features", config="paper"
    ),
    "estimates/points/ekf": lambda: on_points("ekf"),
    "estimates/intel/shunting": lambda: on_intel("shunting", 910)[0],
    "estimates/intel/occupancy": lambda: on_intel("occupancy", 200)[0],
    "estimates/intel/ekf": lambda: on_intel("ekf", 200)[0],
    "episode": episode,
    "compare": compared,
    "film": film,
}


def read() -> dict[str, Any]:
    """``made_with`` and ``results`` on file."""
    found: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return found


def main() -> int:
    """Print what differs; with ``--write`` record it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="record today's results")
    parser.add_argument("--only", default="", metavar="WORD", help="those whose name holds it")
    wanted = parser.parse_args()
    before = read() if FILE.exists() else {"results": {}}
    results = dict(before["results"])
    for name, make in MAKERS.items():
        if wanted.only not in name:
            continue
        try:
            results[name] = make()
        except Missing as error:
            print(f"{name}: left as it was: {error}")
            results[name] = before["results"][name]
        same = results[name] == before["results"].get(name)
        print(f"{'same   ' if same else 'CHANGED'} {name}", flush=True)
    changed = results != before["results"]
    if wanted.write:
        text = {"made_with": made_with(), "results": results}
        FILE.write_text(json.dumps(text, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    return int(changed and not wanted.write)


if __name__ == "__main__":
    sys.exit(main())

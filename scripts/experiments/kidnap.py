# SPDX-License-Identifier: Apache-2.0
"""Kidnap test: does the SLAM notice, and find itself again?

``python -m scripts.experiments.kidnap``.

The robot maps the office on one tour. Then it is put, between two scans, to where it stands at some
moment of another tour through the same office at another time (other people, other noise, chairs
elsewhere), at least 3 m or 90 degrees away, near a place it has mapped. The odometry knows nothing
of it. What counts: scans until the estimate is not trusted, seconds until it is again, and where;
and the processor time of the scans at which it is not trusted.

With ``--log FILE`` it maps a log, and is then put back to an earlier part of the same log. The
place where it was then estimated to be counts as the right one.
"""

from __future__ import annotations

import copy
import math
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scripts.experiments.shared import Row
from scripts.experiments.study import Study
from sim.core.dynamism import Dynamism
from sim.core.seeds import Seeds
from sim.simulation import stream
from slam import SlamSystem, create, se2
from slam.frames import Float, Frame, Odometry, Scan
from slam.frontend.odometry_steps import thinned
from slam.logs import open_log

FAR_M, FAR_RAD = 3.0, math.pi / 2.0
KNOWN_M, KNOWN_RAD = 1.0, 1.0  # the new place is that near to one of the mapping tour
RIGHT_M, RIGHT_RAD = 0.3, 0.2
AFTER_S = 10.0
LEAST_AFTER = 40  # scans followed at least
DETECTED_WITHIN = 3  # scans


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One kidnap. ``detected`` scans until not trusted, ``recovered_s`` until trusted again."""

    seed: int
    moved_m: float
    detected: int | None
    recovered_s: float | None
    error_m: float | None  # when it trusts itself again
    right: bool  # trusted at the end, and where it truly is
    wrong: bool  # ever trusted elsewhere after having been lost, or never suspicious
    spent_ms: tuple[float, ...] = ()  # of the scans at which it was lost, and the one that found it


def recording(
    seed: int,
    seconds: float,
    dynamism: float,
    *,
    again: bool,
    scene: str = "office",
    every: int = 1,
) -> list[Frame]:
    """One in ``every`` scans of a tour through a scene; ``again``: at another time."""
    other = seed + 1000
    seeds = Seeds(seed)
    if again:
        seeds = Seeds(seed, lidar=other, odometry=other, people=other, driving=other)
    rates = Dynamism.world_1(dynamism)
    size: dict[str, Any] = {"size_m": 40.0, "n_rooms": 40} if scene == "random-rooms" else {}
    return thinned(list(stream(scene, seed=seeds, dynamism=rates, seconds=seconds, **size)), every)


def of_log(slam: SlamSystem, path: Path) -> list[Frame]:
    """The frames of a log, with the poses at which ``slam`` saw them as truth."""
    return [
        replace(frame, truth=slam.update(frame.without_truth()).T_map_robot)
        for frame in open_log(path)
    ]


def targets(mapped: list[Frame], later: list[Frame], scans: int, count: int) -> Iterator[int]:
    """Moments of ``later`` to be put to."""
    tour = np.array([frame.truth for frame in mapped])
    end = tour[-1]
    rng = np.random.default_rng(len(later))
    found = 0
    for k in rng.permutation(np.arange(1, len(later) - scans)).tolist():
        place = later[k].truth
        assert place is not None
        jump = place - end
        far = math.hypot(jump[0], jump[1]) >= FAR_M or abs(se2.wrap(float(jump[2]))) >= FAR_RAD
        near = ((tour[:, :2] - place[:2]) ** 2).sum(axis=1) < KNOWN_M**2
        known = near & (np.abs(se2.wrap_array(tour[:, 2] - place[2])) < KNOWN_RAD)
        if far and known.any():
            yield k
            found += 1
            if found == count:
                return


def kidnapped(mapped: list[Frame], later: list[Frame], start: int, scans: int) -> Iterator[Frame]:
    """Frames of ``later`` from ``start`` on as they follow the last of ``mapped`` unawares."""
    T_odom_robot: Float = mapped[-1].odometry.T_odom_robot
    stamp_ns, period_ns = mapped[-1].stamp_ns, mapped[1].stamp_ns - mapped[0].stamp_ns
    for before, now in zip(later[start - 1 :], later[start : start + scans], strict=False):
        increment = se2.between(before.odometry.T_odom_robot, now.odometry.T_odom_robot)
        T_odom_robot = se2.compose(T_odom_robot, increment)
        stamp_ns += period_ns
        assert now.scan is not None
        yield Frame(
            stamp_ns=stamp_ns,
            odometry=Odometry(
                stamp_ns=stamp_ns,
                T_odom_robot=T_odom_robot,
                increment_covariance=now.odometry.increment_covariance,
                twist=now.odometry.twist,
            ),
            scan=Scan(stamp_ns=stamp_ns, ranges=now.scan.ranges, spec=now.scan.spec),
            truth=now.truth,
            labels=now.labels,
        )


def scans_after(mapped: list[Frame]) -> int:
    """So many scans follow a kidnap: those of ``AFTER_S``, and ``LEAST_AFTER`` at least."""
    period_ns = float(np.median(np.diff([frame.stamp_ns for frame in mapped])))
    return max(round(AFTER_S * 1e9 / period_ns), LEAST_AFTER)


def follow(
    slam: SlamSystem, frames: list[Frame], T_world_map: Float, moved_m: float, seed: int
) -> Outcome:
    """Let a copy of ``slam`` live through it."""
    slam = copy.deepcopy(slam)
    detected: int | None = None
    recovered_s, error_m, wrong, right = None, None, False, False
    first, spent_ms, trusted = frames[0], [], True
    for k, frame in enumerate(frames):
        began = time.process_time()
        estimate = slam.update(frame.without_truth())
        if not (trusted and estimate.converged):
            spent_ms.append(1e3 * (time.process_time() - began))
        trusted = estimate.converged
        assert frame.truth is not None
        error = estimate.T_map_robot - se2.between(T_world_map, frame.truth)
        away = math.hypot(error[0], error[1])
        right = away < RIGHT_M and abs(se2.wrap(float(error[2]))) < RIGHT_RAD
        if not estimate.converged:
            right = False
            if detected is None:
                detected = k + 1
        elif detected is not None:
            wrong = wrong or not right
            if recovered_s is None:
                recovered_s, error_m = (frame.stamp_ns - first.stamp_ns) * 1e-9, away
    return Outcome(
        seed=seed, moved_m=moved_m, detected=detected, recovered_s=recovered_s, error_m=error_m,
        right=right, wrong=wrong or detected is None, spent_ms=tuple(spent_ms),
    )  # fmt: skip


def kidnaps(
    slam: SlamSystem, mapped: list[Frame], later: list[Frame], count: int, seed: int
) -> Iterator[Outcome]:
    """``count`` kidnaps of ``slam``, which has seen ``mapped``, to places of ``later``."""
    T_world_map = mapped[0].truth
    assert T_world_map is not None
    scans = scans_after(mapped)
    for start in targets(mapped, later, scans, count):
        frames = list(kidnapped(mapped, later, start, scans))
        from_, to = mapped[-1].truth, frames[0].truth
        assert from_ is not None
        assert to is not None
        moved_m = math.hypot(*(to - from_)[:2].tolist())
        yield follow(slam, frames, T_world_map, moved_m, seed)


def run(case: Row) -> Row:
    """Of a log, or of one scene."""
    slam = create(case["slam"])
    if case["log"]:
        later = mapped = of_log(slam, Path(case["log"]))
    else:
        mapped, later = (
            recording(
                case["seed"], case["seconds"], case["level"], again=again, scene=case["scene"],
                every=case["every"],
            )
            for again in (False, True)
        )  # fmt: skip
        for frame in mapped:
            slam.update(frame.without_truth())
    found = kidnaps(slam, mapped, later, case["each"], case["seed"])
    return {"kidnaps": [asdict(one) for one in found]}


def tell(rows: Sequence[Row]) -> str:
    """A summary of all kidnaps."""
    all_of = [one for row in rows for one in row["kidnaps"]]
    soon = sum(o["detected"] is not None and o["detected"] <= DETECTED_WITHIN for o in all_of)
    times = sorted(o["recovered_s"] for o in all_of if o["recovered_s"] is not None) or [math.nan]
    spent = [ms for one in all_of for ms in one["spent_ms"]] or [math.nan]
    p50, p99, p999 = np.percentile(spent, [50.0, 99.0, 99.9]).tolist()
    return (
        f"{len(all_of)} kidnaps: {soon} detected within {DETECTED_WITHIN} scans, "
        f"{sum(o['right'] for o in all_of)} at the right place after {AFTER_S:g} s, "
        f"{sum(o['wrong'] for o in all_of)} accepted at a wrong one; "
        f"time to recover: median {np.median(times):.2f} s, worst {times[-1]:.2f} s\n"
        f"{len(spent)} scans while lost, processor time: p50 {p50:.1f}, p99 {p99:.1f}, "
        f"p99.9 {p999:.1f}, longest {max(spent):.1f} ms"
    )


STUDY = Study(
    name="kidnap",
    axes={"scene": ("office",), "level": (0.5,), "every": (1,), "each": (6,), "log": ("",),
          "slam": ("shunting",)},
    run=run, data=lambda case: [Path(case["log"])] if case["log"] else [], tell=tell,
    defaults={"seeds": 5, "first_seed": 100, "seconds": 90.0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())

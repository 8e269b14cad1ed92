# SPDX-License-Identifier: Apache-2.0
"""What studies share: drives to run on, what is counted of a SLAM's run, columns of tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

import scenes
from scripts.benchmark.tracks import chosen
from scripts.comparison.entry import scored
from scripts.comparison.recording import Recording
from scripts.comparison.tables import number
from scripts.metrics.judged import Judged, world_truth
from scripts.metrics.table import METRICS
from slam.evaluation import lost
from slam.frames import NS_PER_S, Frame
from slam.frontend.odometry_steps import MotionSum
from slam.replay import Track
from slam.system import create
from slam.trajectory import Trajectory

CM, PERCENT = 100.0, 100.0
Row = dict[str, Any]
Column = Callable[[Sequence[Row]], str]


def kept(frames: Sequence[Frame], every: int) -> list[Frame]:
    """The first frame of each ``every``, with the covariance of all the motion in between."""
    out, motion = [], MotionSum()
    for k, frame in enumerate(frames):
        motion.add(frame.odometry)
        if k % every == 0:
            out.append(motion.passed_on(frame))
    return out


def judged(case: Row, drive: Recording) -> Row:
    """The run of ``case["slam"]`` over one frame in ``case["every"]`` (all): each column of a
    comparison, and what it admitted.

    error_m, lost_s  up to the loss, without the time after the robot was carried elsewhere
    due, told        scans that are off for long enough, and those of them that it admits
    good, false      scans that are not off, and those of them that it does not trust
    """
    every = case.get("every", 1)
    frames = kept(drive.frames, every)
    track, truth = Track(case["slam"], create(case["slam"])), world_truth(frames)
    failure = track.survive(frames)
    final = None if failure else track.final()
    row = scored(track, final, failure, truth)
    if failure is not None:
        return row | {"error_m": math.inf, "lost_s": row["lost_at_s"]}
    run = Judged.of(track, truth)
    off, converged, due = run.is_off(), run.converged(), run.is_due()
    lost_s, error_m = _loss(run, drive.truth(), every)
    counts = {
        "due": due, "told": due & run.is_told(), "good": ~off, "false": ~off & ~converged,
        "doubted": ~converged,
    }  # fmt: skip
    row |= {name: int(which.sum()) for name, which in counts.items()}
    return row | {"error_m": error_m, "lost_s": lost_s}


def _loss(run: Judged, whole: Trajectory, every: int) -> tuple[float | None, float]:
    """When it was lost, s, None for never; root mean square error, m, of what counts before.

    What is excused is decided at the full rate: the same at each.
    """
    moments = (whole.stamps_ns - whole.stamps_ns[0]) / NS_PER_S
    excused = lost.excused(moments, whole.poses[:, :2])[::every]
    seconds = (run.pairs.stamps_ns - run.pairs.stamps_ns[0]) / NS_PER_S
    off, turned = run.pairs.distances, run.pairs.errors[:, 2]
    at = lost.lost_at(seconds, np.where(excused, 0.0, off), np.where(excused, 0.0, turned))
    counts = ~excused & (seconds < (math.inf if at is None else at))
    return at, math.sqrt(float((off[counts] ** 2).mean()))


def on_stream(name: str, level: float, seed: int, seconds: float) -> Row:
    """Every scan of a scene at that dynamism, or of that level of a track, which lasts as the track
    does; ``UnknownNameError`` for neither, ``InvalidValueError`` for a level that it has not."""
    if name in scenes.names():
        return {"scene": name, "seed": seed, "dynamism": level, "seconds": seconds,
                "scanner": "noise"}  # fmt: skip
    plan = chosen([name])[0].plan((), (seed,), levels=(level,))
    return asdict(plan.recipe(plan.runs()[0]))


def world_1(case: Row, scanner: str = "noise", **changes: Any) -> Row:
    """A scene at ``case["level"]`` as dynamism was in world 1: no crowd, and nothing changes."""
    recipe = {"scene": case["scene"], "dynamism": case["level"], "change": 0.0,
              "options": {"crowd": "none"}}  # fmt: skip
    return {
        **recipe,
        "seed": case["seed"],
        "seconds": case["seconds"],
        "scanner": scanner,
        **changes,
    }


def of(
    key: str, how: Callable[[Any], Any] = np.median, scale: float = 1.0, form: str = "{:.2f}"
) -> Column:
    """A column: ``how`` of that number over the rows that have it; of a failed run's error inf."""

    def tell(rows: Sequence[Row]) -> str:
        of_metric = key in METRICS and "outcome" in rows[0]
        found = (number(row, key) if of_metric else row.get(key) for row in rows)
        values = np.array([v for v in found if v is not None and not math.isnan(v)])
        return form.format(scale * float(how(values))) if len(values) else "–"

    return tell


def share(part: str, whole: str, form: str = "{:.0f} %") -> Column:
    """A column: the sum of one number over that of another, in percent."""

    def tell(rows: Sequence[Row]) -> str:
        total = sum(row.get(whole, 0) for row in rows)
        return (
            form.format(PERCENT * sum(row.get(part, 0) for row in rows) / total) if total else "–"
        )

    return tell


def losses(rows: Sequence[Row]) -> str:
    """A column: runs lost, of how many."""
    return f"{sum(row['lost'] for row in rows)} of {len(rows)}"


def geometric(values: Sequence[float]) -> float:
    """Mean."""
    return math.exp(float(np.log(values).mean()))

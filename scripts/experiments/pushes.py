# SPDX-License-Identifier: Apache-2.0
"""Does the SLAM come back from a push? ``python -m scripts.experiments.pushes``.

In each stream of ``honesty`` the pose in the SLAM is displaced at a random moment between 0.3 and
0.85 of the stream, by ``PUSH_M`` in a random direction or by ``PUSH_DEG``; nothing else in it
learns of that (``Tracker.displace``). It is back when it stays within ``BACK_M`` and ``BACK_DEG``
of the run without the push for ``STAYS_S``.
"""

from __future__ import annotations

import copy
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scripts.comparison.recording import Recording
from scripts.experiments.honesty import SCENES, TRAIN, crowd, trained
from scripts.experiments.shared import Row
from scripts.experiments.study import Study
from slam import se2
from slam.answers import asked
from slam.frames import NS_PER_S, Float, Frame
from slam.oracle import shown
from slam.shunting import ShuntingSlam

PUSH_M, PUSH_DEG = 0.3, 5.0
BACK_M, BACK_DEG, STAYS_S = 0.05, 1.0, 1.0
WATCHED_S = 15.0  # after a push
WANTED_S = 3.0  # to be back
KINDS = ("m", "deg")


def push(kind: str, rng: np.random.Generator) -> Float:
    """(3,) m, m, rad: one of ``KINDS``, in a random direction."""
    if kind == "deg":
        return np.array([0.0, 0.0, math.radians(PUSH_DEG) * rng.choice([-1.0, 1.0])])
    way = rng.uniform(0.0, math.tau)
    return np.array([PUSH_M * math.cos(way), PUSH_M * math.sin(way), 0.0])


def run(case: Row, drive: Recording) -> Row:
    """Seconds until it is back, None for never."""
    frames, system = drive.frames, ShuntingSlam()
    place = len(case["scene"]), KINDS.index(case["push"])
    rng = np.random.default_rng([case["seed"], round(100 * case["motion"]), *place])
    at = int(rng.integers(int(0.3 * len(frames)), int(0.85 * len(frames))))
    for frame in frames[:at]:
        asked(system, shown(system, frame))
    pushed = copy.deepcopy(system)
    pushed.displace(push(case["push"], rng))
    until = frames[at].stamp_ns + round(WATCHED_S * NS_PER_S)
    return {
        "scan": at,
        "back_s": _back_s(system, pushed, [f for f in frames[at:] if f.stamp_ns <= until]),
    }


def _back_s(system: ShuntingSlam, pushed: ShuntingSlam, frames: Sequence[Frame]) -> float | None:
    seconds, back = [], []
    for frame in frames:
        poses = [asked(one, shown(one, frame)).T_map_robot for one in (pushed, system)]
        x, y, turn = (poses[0] - poses[1]).tolist()
        seconds.append((frame.stamp_ns - frames[0].stamp_ns) / NS_PER_S)
        back.append(math.hypot(x, y) < BACK_M and abs(se2.wrap(turn)) < math.radians(BACK_DEG))
    for k, began in enumerate(seconds):
        if all(near for near, s in zip(back[k:], seconds[k:], strict=True) if s <= began + STAYS_S):
            return began
    return None


def quick(rows: Sequence[Row]) -> str:
    """How many are back in time."""
    times = [math.inf if row["back_s"] is None else row["back_s"] for row in rows]
    return f"{sum(back <= WANTED_S for back in times)} of {len(times)}"


STUDY = Study(
    name="pushes",
    axes={"scene": SCENES, "motion": tuple(TRAIN), "push": KINDS},
    drive=crowd, fits=trained, run=run, lines=("push",),
    columns={f"back within {WANTED_S:g} s": quick},
    told=f"Pushed by {PUSH_M:g} m, or by {PUSH_DEG:g} degrees.",
    page=Path("docs/uncertainty.md"), defaults={"seeds": 20, "first_seed": 0, "seconds": 50.0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())

# SPDX-License-Identifier: Apache-2.0
"""Lost, or the map outdated: is the verdict right where the recording says which it is?

``python -m scripts.experiments.verdict``.

*Outdated*: rooms full of chairs that are all put elsewhere while out of sight (change 1); counted
where the pose is right to 5 cm and the map explains less than usual. *Lost*: the robot is carried
to another place that it has mapped (``kidnap``); counted while its pose is off by more than half a
metre, once the map explains less than usual. The score is ``diagnostics["p_lost"]``.
"""

from __future__ import annotations

import argparse
import copy
import math
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from scripts.experiments.kidnap import RIGHT_M, kidnapped, recording, targets
from scripts.experiments.measured import ended
from sim.simulation import stream
from slam import SlamSystem, create, se2
from slam.frames import Float, Frame
from slam.frontend.odometry_sum import thinned

RIGHT_POSE_M, WRONG_POSE_M = 0.05, 0.5
DOUBT = 0.02  # p_lost above which the map explains less than usual: three quarters of it
AFTER = 60  # scans followed after a kidnap


@dataclass(frozen=True, kw_only=True)
class Seen:
    """One scan: how far off the pose is, and what the SLAM says."""

    error_m: float
    state: str
    verdict: str
    p_lost: float


def follow(slam: SlamSystem, frames: Iterable[Frame], T_world_map: Float) -> list[Seen]:
    """What ``slam`` says of each frame."""
    said = []
    for frame in frames:
        estimate = slam.update(frame.without_truth())
        assert frame.truth is not None
        x, y, _ = (estimate.T_map_robot - se2.between(T_world_map, frame.truth)).tolist()
        words = estimate.diagnostics
        said.append(
            Seen(
                error_m=math.hypot(x, y), state=words["state"], verdict=words["verdict"],
                p_lost=words["p_lost"],
            )
        )  # fmt: skip
    return said


def changed(name: str, seed: int, seconds: float, every: int) -> list[Seen]:
    """All that the robot has seen stands elsewhere when it comes back."""
    room: dict[str, Any] = {"n_chairs": 60, "n_people": 0, "clutter": 0.1, "crowd": "none"}
    made = stream(
        "random-rooms", seed=seed, motion=0.0, change=1.0, seconds=seconds,
        change_at_s=seconds / 2.0, **room,
    )  # fmt: skip
    frames = thinned(list(made), every)
    assert frames[0].truth is not None
    return follow(create(name), frames, frames[0].truth)


def carried(name: str, seed: int, seconds: float, every: int, each: int) -> Iterator[list[Seen]]:
    """The robot is put elsewhere, ``each`` times from the same end of a tour."""
    mapped, later = (
        recording(seed, seconds, 0.5, again=again, every=every) for again in (False, True)
    )
    slam, T_world_map = create(name), mapped[0].truth
    assert T_world_map is not None
    for frame in mapped:
        slam.update(frame.without_truth())
    for start in targets(mapped, later, AFTER, each):
        yield follow(copy.deepcopy(slam), kidnapped(mapped, later, start, AFTER), T_world_map)


def area(lost: Float, outdated: Float) -> float:
    """Under the ROC: how often a scan of ``lost`` scores higher than one of ``outdated``."""
    if not len(lost) or not len(outdated):
        return math.nan
    below = np.searchsorted(np.sort(outdated), lost, side="left")
    upto = np.searchsorted(np.sort(outdated), lost, side="right")
    return float((below + upto).mean()) / (2.0 * len(outdated))


def main(arguments: list[str] | None = None) -> int:
    """Print the area under the ROC, and what the verdicts are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slam", default="shunting")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(6)))
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--every", type=int, default=8, help="scans, of which one is seen")
    parser.add_argument("--each", type=int, default=4, help="kidnaps for each seed")
    wanted = parser.parse_args(arguments)
    outdated, lost, wrong, found, kidnaps, false = [], [], 0, 0, 0, 0
    for seed in wanted.seeds:
        right = changed(wanted.slam, seed, wanted.seconds, wanted.every)
        right = [s for s in right if s.error_m < RIGHT_POSE_M]
        false += sum(s.state == "lost" for s in right)
        outdated += [s for s in right if s.state != "blind"]
        for said in carried(wanted.slam, seed, wanted.seconds / 2, wanted.every, wanted.each):
            again = [k for k, s in enumerate(said) if s.state == "relocated"]
            kidnaps, found = kidnaps + 1, found + bool(again)
            wrong += any(said[k].error_m > RIGHT_M for k in again)
            until = said[: again[0]] if again else said
            lost += [s for s in until if s.error_m > WRONG_POSE_M]
    doubtful = [s for s in outdated if s.p_lost > DOUBT]
    for title, scans in (("all scans", outdated), ("scans in doubt", doubtful)):
        of = area(np.array([s.p_lost for s in lost]), np.array([s.p_lost for s in scans]))
        print(f"{title}: {len(scans)} outdated, {len(lost)} lost, area under the ROC {of:.4f}")
    for title, scans in (("outdated", outdated), ("lost", lost)):
        print(f"{title}: {dict(Counter(s.verdict for s in scans))}")
    print(
        f"lost while the pose is right to {100.0 * RIGHT_POSE_M:g} cm: {false} scans; "
        f"{kidnaps} kidnaps: {found} found again, {wrong} of them at a wrong place"
    )
    return 0


if __name__ == "__main__":
    sys.exit(ended(main))

# SPDX-License-Identifier: Apache-2.0
"""Lost, or the map outdated? ``python -m scripts.experiments.verdict_tracks``.

*Outdated*: scans of tracks on which things stand elsewhere, where the pose is right to 5 cm.
*Lost*: scans at which the pose is off by more than half a metre: after a kidnap of the track
``kidnapped-in-a-crowd``, or after the pose in the SLAM was pushed by 1 to 5 m (``displace``), until
it is nearer again. What it says is ``diagnostics["p_lost"]``. The area under the ROC has a 95 %
interval by resampling the streams, not the scans: those of one stream are alike.

Streams are on training seeds.
"""

from __future__ import annotations

import copy
import math
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scripts.benchmark.tracks import chosen
from scripts.comparison.recording import Recording
from scripts.experiments.kidnap import RIGHT_M
from scripts.experiments.measured import table
from scripts.experiments.shared import Row, on_stream
from scripts.experiments.study import Study
from scripts.options import whole
from slam import SlamSystem, se2
from slam.frames import NS_PER_S, Float, Frame
from slam.shunting import ShuntingSlam

CHANGES = ("moving-day", "overnight", "warehouse-shift")
KIDNAPS = ("kidnapped-in-a-crowd",)
RIGHT_POSE_M, WRONG_POSE_M = 0.05, 0.5
PUSH_M = (1.0, 5.0)  # by which the pose is pushed, least and most
PUSH_DEG = 60.0  # and turned, at most, to either side
AFTER_S = 8.0  # followed after a push
MAPPED_S = 20.0  # before it
RESAMPLED, SURE = 1000, 0.95
WORDS = ("tracking", "map outdated here", "lost", "blind")


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
        words = {key: estimate.diagnostics[key] for key in ("state", "verdict", "p_lost")}
        said.append(Seen(error_m=math.hypot(x, y), **words))
    return said


def area(lost: Float, outdated: Float) -> float:
    """Under the ROC: how often a scan of ``lost`` scores higher than one of ``outdated``."""
    if not len(lost) or not len(outdated):
        return math.nan
    below = np.searchsorted(np.sort(outdated), lost, side="left")
    upto = np.searchsorted(np.sort(outdated), lost, side="right")
    return float((below + upto).mean()) / (2.0 * len(outdated))


def moments(frames: Sequence[Frame], count: int, seed: int) -> list[tuple[int, Float]]:
    """At which scans the pose is pushed, and by what (3,) along the axes of the map."""
    rng = np.random.default_rng([seed, len(frames)])
    seconds = np.array([(f.stamp_ns - frames[0].stamp_ns) / NS_PER_S for f in frames])
    free = np.flatnonzero((seconds >= MAPPED_S) & (seconds <= seconds[-1] - AFTER_S))
    out = []
    for k in sorted(rng.choice(free, count, replace=False).tolist()):
        far, way = rng.uniform(*PUSH_M), rng.uniform(0.0, math.tau)
        turn = math.radians(rng.uniform(-PUSH_DEG, PUSH_DEG))
        out.append((k, np.array([far * math.cos(way), far * math.sin(way), turn])))
    return out


def run(case: Row, drive: Recording) -> Row:
    """What the SLAM says of each scan, and of those after each push."""
    whole("--pushes", case["pushes"], 0)
    frames = drive.frames
    pushes, start = dict(moments(frames, case["pushes"], case["seed"])), frames[0].truth
    assert start is not None
    slam, said, after = ShuntingSlam(), [], []
    for k, frame in enumerate(frames):
        if k in pushes:
            pushed = copy.deepcopy(slam)
            pushed.displace(pushes[k])
            until = frame.stamp_ns + round(AFTER_S * NS_PER_S)
            after.append(follow(pushed, [f for f in frames[k:] if f.stamp_ns <= until], start))
        said += follow(slam, [frame], start)
    return judged(case["track"], said, after)


def until_found(said: Sequence[Seen]) -> list[Seen]:
    """The scans after a push up to the first at which the pose is near again."""
    out = []
    for one in said:
        if one.error_m <= WRONG_POSE_M:
            break
        out.append(one)
    return out


def judged(track: str, said: Sequence[Seen], after: Sequence[Sequence[Seen]]) -> Row:
    """The scores ``p_lost`` of the scans that count, and what came of pushes."""
    changes = track in CHANGES
    right = [s for s in said if s.error_m < RIGHT_POSE_M and s.verdict != "blind"]
    gone = [] if changes else [s for s in said if s.error_m > WRONG_POSE_M]
    pushed = [s for one_push in after for s in until_found(one_push)]
    back = [[s for s in one_push if s.state == "relocated"] for one_push in after]
    return {
        "outdated": [s.p_lost for s in right] if changes else [],
        "kidnapped": [s.p_lost for s in gone],
        "pushed": [s.p_lost for s in pushed],
        "outdated_words": Counter(s.verdict for s in right) if changes else {},
        "lost_words": Counter(s.verdict for s in (*gone, *pushed)),
        "tried": len(after),
        "back": sum(one_push[-1].error_m < RIGHT_M for one_push in after),
        "wrong": sum(any(s.error_m > RIGHT_M for s in found) for found in back),
    }


def scores(rows: Sequence[Row], *kinds: str) -> Float:
    """All of these kinds, of these streams."""
    return np.array([p for row in rows for kind in kinds for p in row[kind]])


def interval(rows: Sequence[Row], *lost: str) -> tuple[float, float, float]:
    """Area under the ROC, least and most of it by resampling the streams."""
    gone = [row for row in rows if any(row[kind] for kind in lost)]
    here = [row for row in rows if row["outdated"]]
    rng, areas = np.random.default_rng(0), []
    for _ in range(RESAMPLED if gone and here else 0):
        some = [gone[k] for k in rng.integers(len(gone), size=len(gone))]
        others = [here[k] for k in rng.integers(len(here), size=len(here))]
        areas.append(area(scores(some, *lost), scores(others, "outdated")))
    ends = np.quantile(areas, [0.5 - SURE / 2.0, 0.5 + SURE / 2.0]) if areas else (math.nan,) * 2
    whole = area(scores(gone, *lost), scores(here, "outdated"))
    return whole, float(ends[0]), float(ends[1])


def markdown(rows: Sequence[Row]) -> str:
    """Areas, verdicts, and what came of the pushes."""
    cells = []
    for title, kinds in (
        ("kidnapped", ("kidnapped",)), ("pushed by 1 to 5 m", ("pushed",)),
        ("both", ("kidnapped", "pushed")),
    ):  # fmt: skip
        of, low, high = interval(rows, *kinds)
        n = len(scores(rows, *kinds))
        cells.append(
            [f"lost: {title}", str(n), str(len(scores(rows, "outdated"))),
             f"{of:.3f}", f"{low:.3f} to {high:.3f}"]
        )  # fmt: skip
    first = table(("", "scans lost", "scans outdated", "area under the ROC", "95 %"), cells)
    words: Mapping[str, Counter[str]] = {
        "pose right, room changed": sum(
            (Counter(row["outdated_words"]) for row in rows), Counter()
        ),
        "pose wrong": sum((Counter(row["lost_words"]) for row in rows), Counter()),
    }
    shares = [
        [title, *(f"{100.0 * count[word] / max(count.total(), 1):.1f} %" for word in WORDS)]
        for title, count in words.items()
    ]
    second = table(("truth", *WORDS), shares)
    pushes, back, wrong = (sum(row[key] for row in rows) for key in ("tried", "back", "wrong"))
    third = (
        f"Of {pushes} pushes, {back} are undone after {AFTER_S:g} s; {wrong} times a place was "
        f"accepted that is more than {RIGHT_M:g} m off."
    )
    return "\n\n".join((first, second, third))


def brief(row: Row) -> Row:
    """Counts, and deciles in the place of the scores."""
    out = {key: value for key, value in row.items() if not isinstance(value, list)}
    for kind in ("outdated", "kidnapped", "pushed"):
        out[kind] = len(row[kind])
        if row[kind]:
            out[f"{kind}_deciles"] = np.quantile(row[kind], np.linspace(0.0, 1.0, 11)).tolist()
    return out


STUDY = Study(
    name="verdict_tracks",
    axes={"track": (*CHANGES, *KIDNAPS), "level": (0.5, 1.0), "pushes": (4,)},
    drive=lambda case: {
        **on_stream(case["track"], case["level"], case["seed"], case["seconds"]),
        "every": chosen([case["track"]])[0].every,
    },
    run=run, tell=markdown, brief=brief,
    told="World {world}, levels {level}, {seeds} training seeds from {first_seed}, {pushes[0]} "
    "pushes in each stream.",
    page=Path("docs/uncertainty.md"), results=True, defaults={"seeds": 3, "first_seed": 0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())

# SPDX-License-Identifier: Apache-2.0
"""Lost, or the map outdated, over the tracks: ``python -m scripts.experiments.verdict_tracks``.

*Outdated*: scans of tracks on which things stand elsewhere, where the pose is right to 5 cm.
*Lost*: scans at which the pose is off by more than half a metre: after a kidnap of the track
``kidnapped-in-a-crowd``, or after the pose in the SLAM was pushed by 1 to 5 m (``displace``), until
it is nearer again. What it says is ``diagnostics["p_lost"]``. The area under the ROC has a 95 %
interval by resampling the streams, not the scans: those of one stream are alike.

Streams are on training seeds; recordings stay in ``--folder``. Writes
``docs/results/verdict_tracks.json`` and a table of ``docs/uncertainty.md``.
"""

from __future__ import annotations

import argparse
import copy
import math
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from scripts import workers
from scripts.benchmark.tracks import chosen
from scripts.checked import whole
from scripts.comparison.recording import load
from scripts.experiments.kidnap import RIGHT_M
from scripts.experiments.measured import add_options, head, seeds_of, table
from scripts.experiments.recorded import RecordedStream, make_missing
from scripts.experiments.verdict import RIGHT_POSE_M, WRONG_POSE_M, Seen, area, follow
from scripts.marks import fill_page
from scripts.result_files import write
from sim.core.versions import WORLD
from slam import create
from slam.errors import MobiliaError
from slam.frames import NS_PER_S, Float, Frame
from slam.shunting import ShuntingSlam

PAGE, MARK = Path("docs/uncertainty.md"), "verdict_tracks"
CHANGES = ("moving-day", "overnight", "warehouse-shift")
KIDNAPS = ("kidnapped-in-a-crowd",)
LEVELS = (0.5, 1.0)
PUSH_M = (1.0, 5.0)  # by which the pose is pushed, least and most
PUSH_DEG = 60.0  # and turned, at most, to either side
AFTER_S = 8.0  # followed after a push
MAPPED_S = 20.0  # before it
RESAMPLED, SURE = 1000, 0.95
WORDS = ("tracking", "map outdated here", "lost", "blind")
Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Stream(RecordedStream):
    """A track at a level with a seed; ``pushes`` into the pose of the SLAM."""

    track: str
    level: float
    seed: int
    pushes: int = 0

    @property
    def name(self) -> str:
        """Of its recording, without the ending."""
        return f"{self.track}_{self.level:g}_s{self.seed}"

    def simulated(self) -> dict[str, Any]:
        """The recipe of the track, and one scan of how many is kept."""
        track = chosen([self.track])[0]
        plan = track.plan((), (self.seed,), levels=(self.level,))
        return {"every": track.every, **asdict(plan.recipe(plan.runs()[0]))}


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


def seen(one: Stream, folder: Path) -> tuple[Stream, list[Seen], list[list[Seen]]]:
    """What the SLAM says of each scan, and of those after each push."""
    frames = load(one.path(folder)).frames
    pushes, start = dict(moments(frames, one.pushes, one.seed)), frames[0].truth
    assert start is not None
    slam, said, after = create("shunting"), [], []
    assert isinstance(slam, ShuntingSlam)
    for k, frame in enumerate(frames):
        if k in pushes:
            pushed = copy.deepcopy(slam)
            pushed.displace(pushes[k])
            until = frame.stamp_ns + round(AFTER_S * NS_PER_S)
            after.append(follow(pushed, [f for f in frames[k:] if f.stamp_ns <= until], start))
        said += follow(slam, [frame], start)
    return one, said, after


def until_found(said: Sequence[Seen]) -> list[Seen]:
    """The scans after a push up to the first at which the pose is near again."""
    out = []
    for one in said:
        if one.error_m <= WRONG_POSE_M:
            break
        out.append(one)
    return out


def judged(results: Sequence[tuple[Stream, list[Seen], list[list[Seen]]]]) -> list[Row]:
    """Of each stream the scores ``p_lost`` of its scans that count, and what came of pushes."""
    rows = []
    for one, said, after in results:
        changes = one.track in CHANGES
        right = [s for s in said if s.error_m < RIGHT_POSE_M and s.verdict != "blind"]
        gone = [] if changes else [s for s in said if s.error_m > WRONG_POSE_M]
        pushed = [s for one_push in after for s in until_found(one_push)]
        back = [[s for s in one_push if s.state == "relocated"] for one_push in after]
        rows.append(
            {
                "track": one.track, "level": one.level, "seed": one.seed,
                "outdated": [s.p_lost for s in right] if changes else [],
                "kidnapped": [s.p_lost for s in gone],
                "pushed": [s.p_lost for s in pushed],
                "outdated_words": Counter(s.verdict for s in right) if changes else Counter(),
                "lost_words": Counter(s.verdict for s in (*gone, *pushed)),
                "pushes": len(after),
                "back": sum(one_push[-1].error_m < RIGHT_M for one_push in after),
                "wrong": sum(any(s.error_m > RIGHT_M for s in found) for found in back),
            }
        )  # fmt: skip
    return rows


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


def markdown(rows: Sequence[Row], told: str) -> str:
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
        "pose right, room changed": sum((row["outdated_words"] for row in rows), Counter()),
        "pose wrong": sum((row["lost_words"] for row in rows), Counter()),
    }
    shares = [
        [title, *(f"{100.0 * count[word] / max(count.total(), 1):.1f} %" for word in WORDS)]
        for title, count in words.items()
    ]
    second = table(("truth", *WORDS), shares)
    pushes, back, wrong = (sum(row[key] for row in rows) for key in ("pushes", "back", "wrong"))
    third = (
        f"Of {pushes} pushes, {back} are undone after {AFTER_S:g} s; {wrong} times a place was "
        f"accepted that is more than {RIGHT_M:g} m off."
    )
    return "\n\n".join((told, first, second, third))


def streams(wanted: argparse.Namespace) -> list[Stream]:
    """All that is asked for."""
    return [
        Stream(track=track, level=level, seed=seed, pushes=wanted.pushes)
        for track, level, seed in product((*CHANGES, *KIDNAPS), wanted.levels, seeds_of(wanted))
    ]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--levels", type=float, nargs="+", default=list(LEVELS))
    parser.add_argument("--pushes", type=int, default=4, help="into the pose, in each stream")
    parser.add_argument("--folder", type=Path, default=Path("out/verdict"), help="of recordings")
    add_options(parser, "verdict_tracks.json", PAGE)
    parser.set_defaults(seeds=3, first_seed=0)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Print areas and verdicts, write the results and the page."""
    wanted = _parser().parse_args(arguments)
    levels = ", ".join(f"{level:g}" for level in wanted.levels)
    told = (
        f"World {WORLD}, levels {levels}, {wanted.seeds} training seeds from {wanted.first_seed}, "
        f"{wanted.pushes} pushes in each stream."
    )
    try:
        whole("--pushes", wanted.pushes, 0)
        first = head(wanted, MARK, arguments, "levels", "pushes")
        asked = streams(wanted)
        make_missing(asked, wanted.folder, wanted.jobs)
        results = list(workers.each(partial(seen, folder=wanted.folder), asked, jobs=wanted.jobs))
        rows = judged(sorted(results, key=lambda result: asked.index(result[0])))
        text = markdown(rows, told)
        keyed = {f"{r['track']} {r['level']:g} {r['seed']}": _brief(r) for r in rows}
        write(wanted.results, first, {"streams": keyed})
        if not wanted.no_page:
            fill_page(wanted.page, MARK, text)
    except (MobiliaError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(text)
    return 0


def _brief(row: Row) -> Row:
    """Counts, and deciles in the place of the scores."""
    out = {key: value for key, value in row.items() if not isinstance(value, list)}
    for kind in ("outdated", "kidnapped", "pushed"):
        out[kind] = len(row[kind])
        if row[kind]:
            out[f"{kind}_deciles"] = np.quantile(row[kind], np.linspace(0.0, 1.0, 11)).tolist()
    return out


if __name__ == "__main__":
    sys.exit(main())

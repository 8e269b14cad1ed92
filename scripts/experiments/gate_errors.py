# SPDX-License-Identifier: Apache-2.0
"""How often is ``mobilia gate`` wrong? Verdicts on a SLAM that is unchanged, or worse by a fifth.

A pool has ``--repeats`` runs of each SLAM on each recording of the gate's usual runs. A trial draws
one run for before and another for now on each, in an order of its own, and asks for the verdict.
So trials share recordings and runs, and differ in what they draw.
"""

import argparse
import json
import math
import random
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from statistics import mean
from typing import Any

import slam as slam_package
from scripts.comparison import recording
from scripts.comparison.entry import scored
from scripts.comparison.plan import RECORDINGS
from scripts.console import ended
from scripts.gate.evidence import change, verdict_of
from scripts.gate.runs import One, of_tracks, recorded
from scripts.imports import source_of, sources
from scripts.jobs import Job, run_jobs
from scripts.marks import fill_page, table
from scripts.names import file_name
from slam.replay import Track
from slam.system import create

ROOT = Path(__file__).resolve().parents[2]
PAGE, EXAMPLE = ROOT / "docs" / "gate.md", ROOT / "docs" / "examples" / "ci"
SCATTERS = "my_slam:MySlam"  # it draws points of each scan by chance
PAIRS = {  # a SLAM as it is, and with a fifth more error: fewer points, larger cells
    "scatters": ((SCATTERS, None), (SCATTERS, 37)),
    "repeats to the bit": (("shunting", None), ("shunting{cell_m=0.044}", None)),
}
HEADS = ("the SLAM", "now", "error", "trials", "worse", "not worse", "undecided", "runs")
KEPT = ("lost", "ate_unaligned_m", "ate_se2_m", "rpe_m_per_s", "rpe_m_per_m")
Row = Mapping[str, Any]
Version = tuple[str, int | None]  # a SLAM, and its points of a scan
Pool = Sequence[Sequence[Row]]  # of each recording the rows of its runs


def repeated(path: Path, *, drive: str, slam: str, points: int | None, repeats: int) -> None:
    """A job: the rows of so many runs of a SLAM on a recording; of ``SCATTERS`` with ``points``."""
    there, rows = recording.load(Path(drive)), []
    for _ in range(repeats):
        system: Any = create(slam)
        if points is not None:
            system.POINTS = points
        track = Track(slam, system)
        row = scored(track, None, track.survive(there.frames), there.truth())
        rows.append({key: row.get(key) for key in KEPT})
    path.write_text(json.dumps(rows))


def pool(runs: Sequence[One], out: Path, version: Version, repeats: int, jobs: int) -> Pool:
    """Rows by recording; the recordings are made where they are missing."""
    drives = [recorded(one.job, out / RECORDINGS) for one in runs]
    slam, points = version
    code = (*sources(slam_package), *source_of(slam))
    wanted = [
        Job(
            name=f"{file_name(slam)}_{points}_{k}", call=repeated, suffix=".json", code=code,
            arguments={"drive": str(drive), "slam": slam, "points": points, "repeats": repeats},
        )
        for k, drive in enumerate(drives)
    ]  # fmt: skip
    files = run_jobs(wanted, out / "rows", processes=jobs, title=slam)
    return [json.loads(files[job.name].read_text()) for job in wanted]


def trial(before: Pool, now: Pool, draws: random.Random) -> tuple[str, int]:
    """The verdict, and after how many runs. Of one and the same pool never a run twice."""
    changes = []
    for k in draws.sample(range(len(before)), len(before)):
        a = draws.randrange(len(before[k]))
        others = [b for b in range(len(now[k])) if now is not before or b != a or len(now[k]) == 1]
        changes.append(change(before[k][a], now[k][draws.choice(others)]))
    return verdict_of(changes)


def times(before: Pool, now: Pool) -> float:
    """Geometric mean of how many times the error, over the recordings, of runs that hold."""
    pairs = (pair for both in zip(before, now, strict=True) for pair in product(*both))
    changes = [value for a, b in pairs if (value := change(a, b)) is not None]
    return math.exp(mean(filter(math.isfinite, changes)))


def row_of(name: str, now: str, pair: tuple[Pool, Pool], trials: int) -> list[str]:
    """One line of the table."""
    draws = random.Random(f"{name} {now}")
    found = [trial(*pair, draws) for _ in range(trials)]
    counts = Counter(verdict for verdict, _ in found)
    of = [str(counts[verdict]) for verdict in HEADS[4:7]]
    return [
        name,
        now,
        f"× {times(*pair):.2f}",
        str(trials),
        *of,
        f"{mean(k for _, k in found):.0f}",
    ]


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, and fill the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of recordings and runs; goes on from there")
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--repeats", type=int, default=8)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--page", type=Path, default=PAGE)
    wanted = parser.parse_args(arguments)
    sys.path.append(str(EXAMPLE))
    runs, rows = of_tracks(), []
    for name, slams in PAIRS.items():
        repeats = wanted.repeats if slams[0][0] == SCATTERS else 1
        pools = [pool(runs, wanted.out, slam, repeats, wanted.jobs) for slam in slams]
        for now, pair in {"unchanged": (pools[0], pools[0]), "worse": (pools[0], pools[1])}.items():
            rows.append(row_of(name, now, pair, wanted.trials))
    told = table(HEADS, rows, left=2)
    print(told)
    fill_page(wanted.page, "gate-errors", told)


if __name__ == "__main__":
    sys.exit(main())

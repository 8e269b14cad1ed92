# SPDX-License-Identifier: Apache-2.0
"""Lost runs of the benchmark, shrunk: ``python -m scripts.experiments.shrunk``.

Of each SLAM the first tracks on which it is lost at the highest level, and there its first lost
seed. A folder of finished runs is gone on with.
"""

import argparse
import csv
import json
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from scripts.benchmark.tracks import TRACKS
from scripts.comparison.again import again_of
from scripts.console import ended
from scripts.debugger.recording import Case
from scripts.debugger.shrinking import FEW, SHORT_S
from scripts.debugger.shrunk import carry_out
from scripts.engine import Stage, make
from scripts.jobs import Job
from scripts.marks import check_page, fill_page, table
from scripts.names import file_name
from scripts.output import RECIPE
from scripts.result_files import RESULTS
from slam.files import write_text

SLAMS = ("shunting", "occupancy", "ekf", "karto", "kiss-icp")
LEVEL, N_TRACKS, MARK = 1.0, 4, "shrink"  # tracks of each SLAM
MOST_BYTES = 1024  # of a recipe that counts as small


def chosen() -> list[tuple[str, str, int]]:
    """SLAM, track and seed of the lost runs, each SLAM's first track first."""
    with (RESULTS / "benchmark.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if float(row["level"]) == LEVEL]
    first: dict[tuple[str, str], int] = {}
    for row in rows:
        if row["lost"] == "1":
            first.setdefault((row["SLAM"], row["track"]), int(row["seed"]))
    of_each = [[(s, t, n) for (s, t), n in first.items() if s == slam] for slam in SLAMS]
    return [own[k] for k in range(N_TRACKS) for own in of_each if k < len(own)]


def shrink(path: Path, *, slam: str, track: str, seed: int) -> None:
    """A job: shrink that run, replay what is left, write the row."""
    of = TRACKS[track]
    plan = of.plan((slam,), (seed,), levels=(LEVEL,), oracles=False)
    found, started = again_of(plan.recipe(plan.runs()[0])), time.perf_counter()
    case = Case(settings=found.settings, seconds=found.seconds, slam=slam, every=of.every)
    with tempfile.TemporaryDirectory() as folder:
        made = carry_out(case, Path(folder) / MARK, overwrite=False, filmed=False)
        size = (Path(folder) / MARK / RECIPE).stat().st_size
    wall_s = time.perf_counter() - started
    row: dict[str, Any] = {"SLAM": slam, "track": track, "seed": seed}
    for word, (before, left) in made.sizes.items():
        row |= {word: before, f"{word} left": left}
    keep = made.world["cut"]["keep"]
    row |= {"recipe, bytes": size, "parts tried": made.tries, "wall, s": round(wall_s)}
    write_text(path, json.dumps({**row, "left": "all" if keep is None else " ".join(keep)}))


def told(rows: Sequence[Mapping[str, Any]]) -> str:
    """What came out in a sentence, and a table of all runs."""
    small = [row for row in rows if row["seconds left"] <= SHORT_S and row["movers left"] <= FEW]
    light = sum(row["recipe, bytes"] <= MOST_BYTES for row in rows)
    return (
        f"{len(small)} of {len(rows)} became at most {SHORT_S:g} s with at most {FEW} movers, "
        f"and {light} recipes have at most 1 kB. Each was replayed, and lost again."
        f"\n\n{table(list(rows[0]), [[str(cell) for cell in row.values()] for row in rows])}"
    )


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/shrunk"), help="finished runs")
    parser.add_argument("--page", type=Path, default=RESULTS.parent / f"{MARK}.md")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    given = parser.parse_args(arguments)
    check_page(given.page, MARK)
    jobs = [
        Job(
            name=f"{file_name(slam)}_{track}_{seed}", call=shrink, suffix=".json",
            arguments={"slam": slam, "track": track, "seed": seed},
        )
        for slam, track, seed in chosen()
    ]  # fmt: skip
    files = make([Stage(title="shrinking", folder="runs", jobs=jobs)], given.out, jobs=given.jobs)
    rows = [json.loads(file.read_text(encoding="utf-8")) for file in files.values()]
    fill_page(given.page, MARK, told(rows))


if __name__ == "__main__":
    raise SystemExit(main())

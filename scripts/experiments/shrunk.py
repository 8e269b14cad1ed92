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
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scripts.benchmark.tracks import TRACKS
from scripts.comparison.again import again_of
from scripts.console import ended
from scripts.debugger.recording import Case
from scripts.debugger.shrunk import shrunk
from scripts.engine import Stage, make
from scripts.film.footage import of_scene
from scripts.jobs import Job
from scripts.names import file_name
from scripts.output import RECIPE, write_recipe
from scripts.result_files import RESULTS
from slam.files import write_text

SLAMS = ("shunting", "occupancy", "ekf", "karto", "kiss-icp")
LEVEL = 1.0


def chosen(slams: Sequence[str], tracks: int) -> list[tuple[str, str, int]]:
    """SLAM, track and seed of the lost runs, each SLAM's first track first."""
    with (RESULTS / "benchmark.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if float(row["level"]) == LEVEL]
    first: dict[tuple[str, str], int] = {}
    for row in rows:
        if row["lost"] == "1":
            first.setdefault((row["SLAM"], row["track"]), int(row["seed"]))
    of_each = [[(s, t, n) for (s, t), n in first.items() if s == slam] for slam in slams]
    return [own[k] for k in range(tracks) for own in of_each if k < len(own)]


def shrink(path: Path, *, slam: str, track: str, seed: int) -> None:
    """A job: shrink that run, replay what is left, write the row."""
    of = TRACKS[track]
    plan = of.plan((slam,), (seed,), levels=(LEVEL,), oracles=False)
    found, started = again_of(plan.recipe(plan.runs()[0])), time.perf_counter()
    made = shrunk(Case(settings=found.settings, seconds=found.seconds, slam=slam, every=of.every))
    wall_s = time.perf_counter() - started
    with of_scene(made.world, view=None) as footage:
        made.check(list(footage.stream))  # raises where it is not lost again
    with tempfile.TemporaryDirectory() as folder:
        write_recipe(Path(folder), "shrink", {"slams": [slam], **made.world})
        size = (Path(folder) / RECIPE).stat().st_size
    row: dict[str, Any] = {"slam": slam, "track": track, "seed": seed}
    for word, (before, left) in made.sizes.items():
        row |= {f"{word}_before": before, f"{word}_left": left}
    keep = made.world["cut"]["keep"]
    row |= {"left": "all" if keep is None else " ".join(keep), "recipe_bytes": size}
    write_text(path, json.dumps({**row, "tries": made.tries, "wall_s": round(wall_s)}))


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--slam", nargs="+", default=list(SLAMS))
    parser.add_argument("--tracks", type=int, default=4, help="of each SLAM")
    parser.add_argument("--out", type=Path, default=Path("out/shrunk"), help="finished runs")
    parser.add_argument("--results", type=Path, default=RESULTS / "shrunk.csv")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    given = parser.parse_args(arguments)
    jobs = [
        Job(
            name=f"{file_name(slam)}_{track}_{seed}", call=shrink, suffix=".json",
            arguments={"slam": slam, "track": track, "seed": seed},
        )
        for slam, track, seed in chosen(given.slam, given.tracks)
    ]  # fmt: skip
    files = make([Stage(title="shrinking", folder="runs", jobs=jobs)], given.out, jobs=given.jobs)
    rows = [json.loads(file.read_text(encoding="utf-8")) for file in files.values()]
    lines = [",".join(rows[0]), *(",".join(map(str, row.values())) for row in rows)]
    write_text(given.results, "\n".join(lines) + "\n")


if __name__ == "__main__":
    raise SystemExit(main())

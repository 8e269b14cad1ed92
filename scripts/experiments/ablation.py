# SPDX-License-Identifier: Apache-2.0
"""What each part of the SLAM is worth on the tracks of the benchmark: one taken out at a time.

``python -m scripts.experiments.ablation``. A cell: drift (RPE per metre, cm/m, geometric mean over
levels and seeds), and the runs lost. The last column is the geometric mean over the tracks, but for
those on which the robot is carried off: there, drift is the way that it was carried.

Each track is a comparison (``mobilia compare``) in ``--folder``: the same command goes on with it.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from scripts.benchmark.scores import LEAST_DRIFT
from scripts.benchmark.tracks import TEST, Track, chosen, newest
from scripts.comparison.make import carry_out
from scripts.comparison.tables import Row, number
from scripts.console import ended
from scripts.experiments.command import add_options, geometric, head, seeds_of
from scripts.marks import table
from scripts.result_files import write
from sim.core.versions import WORLD

CM = 100.0
PARTS = (
    "shunting",
    "shunting{short_term_weight=0}",
    "shunting{trace_s=0}",  # no long-term trace
    "shunting{standing.settled_s=0}",  # all returns have the whole weight
    "shunting{standing.left_s=0}",  # what left is not looked for
    "shunting{standing.came_s=0}",  # what came is not looked for
    "shunting{standing.disagreed=0}",  # odometry over seconds is not asked
    "shunting{carried_per_h=0}",  # never in doubt
    "shunting{tracking.relocalise.least_near=1e6}",  # drift caused by movers is not looked for
    "oracle(shunting)", "oracle(shunting,moving)",
)  # fmt: skip
AXES: Mapping[str, Sequence[Any]] = {
    "track": tuple(track.name for track in newest().values()), "level": (0.75, 1.0), "slam": PARTS,
}  # fmt: skip
OUT = Path("out/ablation")


def drift(rows: Sequence[Row]) -> float:
    """m/m, geometric mean."""
    found = (number(row, "rpe_m_per_m") for row in rows)
    return geometric([max(value, LEAST_DRIFT) for value in found if value is not None])


def both(rows: Sequence[Row]) -> str:
    """The cell of a track."""
    lost = f"{sum(row['lost'] for row in rows)} of {len(rows)}"
    return f"{CM * drift(rows):.2f}, {lost}" if rows else "–"


def overall(rows: Sequence[Row]) -> str:
    """The last column."""
    free = [
        track.name
        for track in chosen(list(dict.fromkeys(row["track"] for row in rows)))
        if not any(sets.get("kidnap_every_s") for sets in track.sets)
    ]
    means = [drift([row for row in rows if row["track"] == track]) for track in free]
    return f"{CM * geometric(means):.2f}" if means else "–"


def markdown(rows: Sequence[Row]) -> str:
    """The table."""
    tracks, lines = list(dict.fromkeys(row["track"] for row in rows)), []
    for slam in dict.fromkeys(row["slam"] for row in rows):
        own = [row for row in rows if row["slam"] == slam]
        cells = (both([row for row in own if row["track"] == track]) for track in tracks)
        lines.append([slam, *cells, overall(own)])
    return table(("slam", *tracks, "all"), lines)


def rows_of(wanted: argparse.Namespace) -> list[Row]:
    """Of each track, level, seed and SLAM, made where it is not there; an oracle where it counts.

    Raises ``UnknownNameError`` for no track, ``InvalidValueError`` for a level that it has not.
    """
    seeds, plans = tuple(seeds_of(wanted)), {}
    for track in chosen(wanted.track):
        plan = track.plan((), seeds, levels=tuple(wanted.level))
        plans[track.name] = replace(plan, slams=fitting(wanted.slam, track))
    return [
        {"track": name, "level": row["dynamism"], **row}
        for name, plan in plans.items()
        for row in carry_out(plan, wanted.folder / name, jobs=wanted.jobs)
    ]


def fitting(slams: Sequence[str], track: Track) -> tuple[str, ...]:
    """Without the oracles that do not count on a track."""
    return tuple(slam for slam in slams if "oracle" not in slam or slam == track.oracle)


def options() -> argparse.ArgumentParser:
    """Of the command."""
    parser = argparse.ArgumentParser(prog="ablation", description=__doc__)
    for axis, values in AXES.items():
        parser.add_argument(f"--{axis}", nargs="+", type=type(values[0]), default=list(values))
    parser.add_argument("--folder", type=Path, default=OUT, help="of recordings and rows")
    add_options(parser, "ablation.json", Path())
    parser.set_defaults(results=OUT / "ablation.json", seeds=len(TEST), first_seed=TEST[0])
    return parser


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """The command: make what is missing, print the table, write the results."""
    wanted = options().parse_args(arguments)
    wanted.no_page = True
    first = head(wanted, "ablation", arguments, *AXES)
    rows = rows_of(wanted)
    keys = [" ".join(str(row[key]) for key in (*AXES, "seed")) for row in rows]
    write(wanted.results, first, {"runs": dict(zip(keys, rows, strict=True))})
    told = f"World {WORLD}, {wanted.seeds} seeds from {wanted.first_seed}, {wanted.seconds:g} s."
    print(f"{told}\n\n{markdown(rows)}")


if __name__ == "__main__":
    sys.exit(main())

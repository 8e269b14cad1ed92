# SPDX-License-Identifier: Apache-2.0
"""What each part of the SLAM is worth on the tracks of the benchmark: one taken out at a time.

``python -m scripts.experiments.ablation``. A cell: drift (RPE per metre, cm/m, geometric mean over
levels and seeds), and the runs lost. The last column is the geometric mean over the tracks, but for
those on which the robot is carried off: there, drift is the way that it was carried.
"""

import sys
from collections.abc import Sequence

from scripts.benchmark.scores import LEAST_DRIFT
from scripts.benchmark.tracks import TEST, Track, chosen, newest
from scripts.comparison.tables import number
from scripts.experiments.study import CM, Row, Study, geometric, judged, losses, on_track

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


def track_of(row: Row) -> Track:
    """``UnknownNameError`` for none."""
    return chosen([row["track"]])[0]


def drift(rows: Sequence[Row]) -> float:
    """m/m, geometric mean."""
    found = (number(row, "rpe_m_per_m") for row in rows)
    return geometric([max(value, LEAST_DRIFT) for value in found if value is not None])


def both(rows: Sequence[Row]) -> str:
    """The cell of a track."""
    return f"{CM * drift(rows):.2f}, {losses(rows)}"


def overall(rows: Sequence[Row]) -> str:
    """The last column."""
    tracks = {row["track"]: track_of(row) for row in rows}
    free = [t for t in tracks if not any(sets.get("kidnap_every_s") for sets in tracks[t].sets)]
    means = [drift([row for row in rows if row["track"] == track]) for track in free]
    return f"{CM * geometric(means):.2f}" if means else "–"


STUDY = Study(
    name="ablation",
    axes={
        "track": tuple(track.name for track in newest().values()),
        "level": (0.75, 1.0), "slam": PARTS,
    },
    drive=lambda case: {
        **on_track(case["track"], case["level"], case["seed"]),
        "every": track_of(case).every,
    },
    run=judged, lines=("slam",),
    fits=lambda case: "oracle" not in case["slam"] or case["slam"] == track_of(case).oracle,
    across="track", cell=both, columns={"all": overall},
    defaults={"seeds": len(TEST), "first_seed": TEST[0]},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())

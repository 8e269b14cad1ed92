# SPDX-License-Identifier: Apache-2.0
"""What the scanner sees of each level: ``python -m scripts.experiments.share_seen``.

Motion: the share of returns (beams that met something) from what moves now, and from what can move
at all; mean over the scans of a run, and the 90th percentile. Change: of all times that a thing
comes into view again after ``--away`` seconds out of it, the share at which it stands more than
0.1 m from where the robot saw it last. People are no things here; of a door the middle of its leaf
counts. Beside these: how much of their way people stood blocked, and how far the robot's tour came.

Writes ``docs/results/share_seen.json`` and the table of ``docs/dynamism.md``. The scanner is coarse
by default (one beam a degree, 5 scans a second), so that it is quick.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import scenes
from scripts.experiments.shared import PERCENT, Column, Row, of
from scripts.experiments.study import Study
from scripts.options import Axis
from sim.driving.pilot import Pilot
from sim.simulation import Simulation, n_frames
from sim.world.world import World
from slam.frames import NS_PER_S, BeamClass, Float, Frame

SCANNER = "scanner(fov_deg=180,beams=181,rate_hz=5,sigma_m=0.01)"
MOVED_M = 0.1  # farther from where it was seen last, a thing stands elsewhere
LEAST_BEAMS = 2  # that meet a thing, for it to be in view


class Resightings:
    """Counts ``again``, things that come back into view, and ``elsewhere``, those that moved."""

    def __init__(self, world: World, away_s: float) -> None:
        movers = world.scene.movers
        self._world, self._away_s = world, away_s
        self._things = np.array([m.kind not in ("robot", "person") for m in movers], dtype=np.bool_)
        self._leaf_m = np.array([0.5 * m.radius if m.kind == "door" else 0.0 for m in movers])
        self._seen_s = np.full(len(movers), np.nan)
        self._seen_at = np.full((len(movers), 2), np.nan)
        self.again = self.elsewhere = 0

    def look(self, frame: Frame) -> None:
        """One scan, with labels, that has just been taken."""
        assert frame.labels is not None
        bodies, now_s = frame.labels.body, self._world.time_ns / NS_PER_S
        movers = self._world.bodies.mover_of_body[bodies[bodies >= 0]]
        beams = np.bincount(movers[movers >= 0], minlength=len(self._things))
        places = self._places(self._world.mover_poses())
        seen = self._things & (beams >= LEAST_BEAMS)
        back = seen & (now_s - self._seen_s >= self._away_s)  # never, where it is NaN
        off = places[back] - self._seen_at[back]
        self.again += int(back.sum())
        self.elsewhere += int((np.sqrt((off * off).sum(axis=1)) > MOVED_M).sum())
        self._seen_s[seen], self._seen_at[seen] = now_s, places[seen]

    def _places(self, poses: Float) -> Float:
        """(movers, 2) m; of a door the middle of its leaf."""
        along = np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        places: Float = poses[:, :2] + self._leaf_m[:, None] * along
        return places


def measure(case: Row) -> Row:
    """One run's row: shares of 1, m, s."""
    settings: dict[str, Any] = Axis(name=case["axis"]).at(case["level"])
    simulation = Simulation(
        case["scene"], seed=case["seed"], laser=case["scanner"], labels=True, **settings
    )
    world, period_s = simulation.world, simulation.scan_period_s
    pilot, resightings = Pilot(world), Resightings(world, case["away"])
    count = n_frames(case["seconds"], period_s)
    kinds, way = np.zeros((count, len(BeamClass)), dtype=np.int64), np.zeros((count, 2))
    for k in range(count):
        world.set_command(*pilot.command(period_s))
        frame = simulation.observe()
        assert frame.labels is not None
        assert frame.truth is not None
        kinds[k] = np.bincount(frame.labels.kind, minlength=len(BeamClass))
        way[k] = frame.truth[:2]
        resightings.look(frame)
    walked, blocked = (float(seconds.sum()) for seconds in world.people.walked_s())
    again = resightings.again
    return {
        **shares(kinds),
        "resightings": again,
        "elsewhere": resightings.elsewhere / again if again else math.nan,
        "blocked": blocked / walked if walked > 0.0 else 0.0,
        "goals": pilot.driver.visited,
        "driven_m": float(np.sqrt((np.diff(way, axis=0) ** 2).sum(axis=1)).sum()),
    }


def shares(kinds: NDArray[np.int64]) -> dict[str, float]:
    """Of (scans, ``BeamClass``) counts; scans without a return count for nothing."""
    returns = kinds[:, BeamClass.STATIC :].sum(axis=1)
    some = returns > 0
    out = {}
    for name, classes in (
        ("moving", (BeamClass.MOVING,)),
        ("movable", (BeamClass.SEMI_STATIC, BeamClass.MOVING)),
    ):
        found = kinds[some][:, classes].sum(axis=1) / returns[some]
        out[name] = float(found.mean()) if len(found) else math.nan
        out[f"{name}_p90"] = float(np.quantile(found, 0.9)) if len(found) else math.nan
    return out


def pair(key: str) -> Column:
    """A column: mean over the runs, and that of the 90th percentile, in percent."""
    mean, high = (of(name, np.mean, PERCENT, "{:.1f}") for name in (key, f"{key}_p90"))
    return lambda rows: f"{mean(rows)} ({high(rows)})"


def elsewhere(rows: Sequence[Row]) -> str:
    """A column: of all sightings of the runs, in percent."""
    again = sum(row["resightings"] for row in rows)
    back = sum(row["elsewhere"] * row["resightings"] for row in rows if row["resightings"])
    return f"{f'{PERCENT * back / again:.1f}' if again else '-'} ({again})"


STUDY = Study(
    name="share_seen",
    axes={"scene": tuple(scenes.names()), "level": (0.0, 0.25, 0.5, 0.75, 1.0),
          "axis": ("dynamism",), "scanner": (SCANNER,), "away": (5.0,)},
    run=measure, lines=("scene", "level"),
    columns={
        "moving, % (p90)": pair("moving"), "can move, % (p90)": pair("movable"),
        "elsewhere, % (of)": elsewhere,
        "people blocked, %": of("blocked", np.mean, PERCENT, "{:.1f}"),
        "goals": of("goals", np.mean, form="{:.1f}"),
        "driven, m": of("driven_m", np.mean, form="{:.0f}"),
    },
    told="World {world}, axis {axis[0]}, {seconds:g} s, {seeds} seeds from {first_seed}, "
    "`{scanner[0]}`, out of view for {away[0]:g} s or more.",
    page=Path("docs/dynamism.md"), results=True, defaults={"seeds": 3},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())

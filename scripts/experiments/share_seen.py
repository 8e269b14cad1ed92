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

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import scenes
from scripts import workers
from scripts.experiments.measured import add_options, head, seeds_of, table
from scripts.knobs import AXES, Axis
from scripts.marks import fill_page
from scripts.result_files import write
from sim.core.versions import WORLD
from sim.driving.pilot import Pilot
from sim.simulation import Simulation, n_frames
from sim.world.world import World
from slam.errors import MobiliaError
from slam.frames import NS_PER_S, BeamClass, Float, Frame

PAGE, MARK = Path("docs/dynamism.md"), "share_seen"
SCANNER = "scanner(fov_deg=180,beams=181,rate_hz=5,sigma_m=0.01)"
MOVED_M = 0.1  # farther from where it was seen last, a thing stands elsewhere
LEAST_BEAMS = 2  # that meet a thing, for it to be in view
WARM_SCANS = 5  # before the processor's time counts: code is being loaded
PERCENT = 100.0
Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Case:
    """One run; ``away_s`` out of view make a sighting one that counts for change."""

    scene: str
    level: float
    seed: int
    axis: str
    seconds: float
    scanner: str
    away_s: float


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


def measure(case: Case) -> Row:
    """One run's row: shares of 1, m, s; ``real_time_factor`` is of this machine."""
    settings: dict[str, Any] = Axis(name=case.axis).at(case.level)
    simulation = Simulation(case.scene, seed=case.seed, laser=case.scanner, labels=True, **settings)
    world, period_s = simulation.world, simulation.scan_period_s
    pilot, resightings = Pilot(world), Resightings(world, case.away_s)
    count, began_s = n_frames(case.seconds, period_s), 0.0
    kinds, way = np.zeros((count, len(BeamClass)), dtype=np.int64), np.zeros((count, 2))
    for k in range(count):
        if k == min(WARM_SCANS, count - 1):
            began_s = time.process_time()
            timed_s = (count - k) * period_s
        world.set_command(*pilot.command(period_s))
        frame = simulation.observe()
        assert frame.labels is not None
        assert frame.truth is not None
        kinds[k] = np.bincount(frame.labels.kind, minlength=len(BeamClass))
        way[k] = frame.truth[:2]
        resightings.look(frame)
    spent_s = time.process_time() - began_s
    walked, blocked = (float(seconds.sum()) for seconds in world.people.walked_s())
    again = resightings.again
    return {
        **asdict(case),
        **shares(kinds),
        "resightings": again,
        "elsewhere": resightings.elsewhere / again if again else float("nan"),
        "blocked": blocked / walked if walked > 0.0 else 0.0,
        "goals": pilot.driver.visited,
        "driven_m": float(np.sqrt((np.diff(way, axis=0) ** 2).sum(axis=1)).sum()),
        "real_time_factor": timed_s / max(spent_s, 1e-9),
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
        out[name] = float(found.mean()) if len(found) else float("nan")
        out[f"{name}_p90"] = float(np.quantile(found, 0.9)) if len(found) else float("nan")
    return out


def summary(rows: Sequence[Row]) -> list[Row]:
    """A row for each scene and level: means over its seeds, of ``elsewhere`` over sightings."""
    out = []
    for scene, level in dict.fromkeys((row["scene"], row["level"]) for row in rows):
        own = [row for row in rows if (row["scene"], row["level"]) == (scene, level)]
        again = sum(row["resightings"] for row in own)
        back = sum(row["elsewhere"] * row["resightings"] for row in own if row["resightings"])
        means = ("moving", "moving_p90", "movable", "movable_p90", "blocked", "goals", "driven_m")
        out.append(
            {"scene": scene, "level": level, "seeds": len(own), "resightings": again}
            | {"elsewhere": back / again if again else float("nan")}
            | {key: float(np.mean([row[key] for row in own])) for key in means}
            | {"real_time_factor": float(np.median([row["real_time_factor"] for row in own]))}
        )
    return out


def markdown(rows: Sequence[Row], told: str) -> str:
    """The table of the page, and in a line how it was made."""
    heads = (
        "scene", "level", "moving, % (p90)", "can move, % (p90)", "elsewhere, % (of)",
        "people blocked, %", "goals", "driven, m",
    )  # fmt: skip
    lines = [
        (
            row["scene"], f"{row['level']:g}", _pair(row, "moving"), _pair(row, "movable"),
            f"{_percent(row['elsewhere'])} ({row['resightings']})", _percent(row["blocked"]),
            f"{row['goals']:.1f}", f"{row['driven_m']:.0f}",
        )
        for row in summary(rows)
    ]  # fmt: skip
    return f"{table(heads, lines)}\n\n{told}"


def _pair(row: Row, key: str) -> str:
    return f"{_percent(row[key])} ({_percent(row[f'{key}_p90'])})"


def _percent(share: float) -> str:
    return "-" if np.isnan(share) else f"{PERCENT * share:.1f}"


def cells(rows: Sequence[Row]) -> dict[str, Row]:
    """By "scene level": numbers of the runs, seed by seed."""
    numbers = (
        "moving", "moving_p90", "movable", "movable_p90", "resightings", "elsewhere", "blocked",
        "goals", "driven_m", "real_time_factor",
    )  # fmt: skip
    out: dict[str, Row] = {}
    for row in rows:
        cell = out.setdefault(f"{row['scene']} {row['level']:g}", {key: [] for key in numbers})
        for key in numbers:
            cell[key].append(row[key])
    return out


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=scenes.names())
    parser.add_argument("--levels", nargs="+", type=float, default=[0.0, 0.25, 0.5, 0.75, 1.0])
    parser.add_argument("--axis", choices=AXES, default="dynamism")
    parser.add_argument("--scanner", default=SCANNER)
    parser.add_argument("--away", type=float, default=5.0, help="s out of view")
    add_options(parser, "share_seen.json", PAGE)
    parser.set_defaults(seeds=3)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the table, write the results and the page."""
    wanted = _parser().parse_args(arguments)
    told = (
        f"World {WORLD}, axis {wanted.axis}, {wanted.seconds:g} s, "
        f"{wanted.seeds} seeds from {wanted.first_seed}, "
        f"`{wanted.scanner}`, out of view for {wanted.away:g} s or more."
    )
    cases = [
        Case(
            scene=scene, level=level, seed=seed, axis=wanted.axis, seconds=wanted.seconds,
            scanner=wanted.scanner, away_s=wanted.away,
        )
        for scene, level, seed in product(wanted.scenes, wanted.levels, seeds_of(wanted))
    ]  # fmt: skip
    order = {(case.scene, case.level, case.seed): k for k, case in enumerate(cases)}
    try:
        first = head(wanted, MARK, arguments, "axis", "scanner", "away", "levels", "scenes")
        rows = list(workers.each(measure, cases, jobs=wanted.jobs))
        rows.sort(key=lambda row: order[row["scene"], row["level"], row["seed"]])
        text = markdown(rows, told)
        write(wanted.results, first, {"seen": cells(rows)})
        if not wanted.no_page:
            fill_page(wanted.page, MARK, text)
    except (MobiliaError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(text)
    for row in summary(rows):
        print(f"{row['scene']} {row['level']:g}: {row['real_time_factor']:.1f} x real time")
    return 0


if __name__ == "__main__":
    sys.exit(main())

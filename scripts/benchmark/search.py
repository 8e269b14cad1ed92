# SPDX-License-Identifier: Apache-2.0
"""Look for rooms that are hard and fair: ``python -m scripts.benchmark.search kidnaps --tries 20``.

Draws tops of tracks from a declared space, and runs them on training seeds, one after another. One
is dropped as soon as the SLAM can no longer lose most of its runs there (``SHARE``), or both
oracles were lost. The cheapest question comes first: the oracles run only where the SLAM was lost.
Each run is a line of ``--out``; the same command goes on from there.
"""

import argparse
import json
import sys
import tempfile
import tomllib
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from scenes.crowd import Crowd
from scripts.benchmark.scores import FAIR_M, TRACKING, Row
from scripts.benchmark.submission import alone, recorded
from scripts.benchmark.tracks import LEVELS, TRAIN, Track
from scripts.comparison.recording import load
from scripts.console import ended
from sim.core.versions import WORLD
from slam.errors import InvalidValueError
from slam.evaluation.statistics import quantile
from slam.frames import BeamClass

SHARE = 0.75  # of the training runs that must be lost: on fresh seeds it is less
LEAST = 3  # runs that an error is judged by
_CROWDS = tuple(each.name for each in fields(Crowd))
_OF_TRACK = ("scene", "scanner", "odometry", "every", "seconds", "oracle")
Space = Mapping[str, Sequence[Any]]
SPACES: Mapping[str, Space] = tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
)


def drawn(space: str, k: int) -> Track:
    """Draw ``k`` of that space: a track with the same at all of its levels."""
    rng = np.random.default_rng([zlib.crc32(space.encode()), k])
    told = {name: of[int(rng.integers(len(of)))] for name, of in SPACES[space].items()}
    own = {name: told.pop(name) for name in _OF_TRACK if name in told}
    crowd = {n: told.pop(f"crowd.{n}") for n in _CROWDS if f"crowd.{n}" in told}
    told["crowd"] = ",".join(f"{name}:{n}" for name, n in crowd.items() if n) or "none"
    sets = {"n_people": 0, **{name: value for name, value in told.items() if value != "never"}}
    return Track(
        name=f"{space}-{k + 1}-v1", about="", world=WORLD, axis="", **own,
        says=("",) * len(LEVELS), sets=(sets,) * len(LEVELS),
    )  # fmt: skip


def tried(track: Track, level: float, seed: int, slam: str) -> Row:
    """One run: the row of the SLAM, and of the oracles where it was lost."""
    plan = track.plan((), (seed,), levels=(level,))
    with tempfile.TemporaryDirectory() as folder:
        drive = load(recorded(plan, Path(folder)))
    rows: dict[str, Row] = {}
    for name in (slam, *track.oracles):
        row, _ = alone(name, drive)
        rows[name] = {key: row.get(key) for key in ("lost", TRACKING)}
        if not rows[slam]["lost"]:
            break
    seen = [f.scan.valid & (f.labels.kind == BeamClass.STATIC)
            for f in drive.frames if f.scan and f.labels]  # fmt: skip
    return {"seed": seed, "walls_share_of_beams": round(float(np.mean(seen)), 3), "slams": rows}


def standing(track: Track, runs: Sequence[Row], slam: str, most: int) -> tuple[str, Row]:
    """Whether it is "open" while runs are missing, "dropped" or "found"; what is known so far."""
    lost, holds = sum(run["slams"][slam]["lost"] for run in runs), list[str]()
    for oracle in track.oracles:
        own = [run["slams"][oracle] for run in runs if oracle in run["slams"]]
        errors = [row[TRACKING] for row in own if row[TRACKING] is not None]
        near = len(errors) < LEAST or quantile(errors, 0.5) <= FAIR_M
        holds += [oracle] if near and not any(row["lost"] for row in own) else []
    hopeless = lost + most - len(runs) < SHARE * most
    state = "dropped" if hopeless or not holds else "found" if len(runs) == most else "open"
    return state, {"lost": lost, "runs": len(runs), "holds": holds}


def search(spaces: Sequence[str], tries: range, seeds: Sequence[int], slam: str, out: Path) -> None:
    """Try draws of each space; prints what each came to."""
    done = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    for k, space in product(tries, spaces):
        track, runs = drawn(space, k), list[Row]()
        state, told = "open", dict[str, Any]()
        while state == "open":
            seed = seeds[len(runs)]
            asked = {"track": track.sha256, "slam": slam, "seed": seed}
            run = next((row for row in done if asked.items() <= row.items()), None)
            try:
                run = run or {**asked, **tried(track, LEVELS[-1], seed, slam)}
            except InvalidValueError as error:  # such as a crowd that has no room
                state, told = "impossible", {"why": str(error)}
                break
            if run not in done:
                with out.open("a") as file:
                    file.write(json.dumps(run) + "\n")
            runs.append(run)
            state, told = standing(track, runs, slam, len(seeds))
        about = {name: getattr(track, name) for name in _OF_TRACK} | dict(track.sets[0])
        print(state, space, k, told, about, flush=True)


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """Search."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("spaces", nargs="+", choices=sorted(SPACES))
    parser.add_argument("--first", type=int, default=0, help="draw")
    parser.add_argument("--tries", type=int, default=20, help="draws")
    parser.add_argument("--seeds", type=int, default=6, help="of the training seeds, for each draw")
    parser.add_argument("--slam", default="shunting")
    parser.add_argument("--out", type=Path, default=Path("out/search.jsonl"))
    wanted = parser.parse_args(arguments)
    wanted.out.parent.mkdir(parents=True, exist_ok=True)
    tries = range(wanted.first, wanted.first + wanted.tries)
    search(wanted.spaces, tries, TRAIN[: wanted.seeds], wanted.slam, wanted.out)


if __name__ == "__main__":
    sys.exit(main())

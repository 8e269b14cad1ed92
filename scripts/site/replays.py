# SPDX-License-Identifier: Apache-2.0
"""A page to turn of every scene and track, for the site: ``python -m scripts.site.replays FOLDER``.

``scene_NAME.html`` and ``track_NAME.html`` as the gallery names its clips; what is there stays.
"""

import argparse
from pathlib import Path
from typing import Any

import scenes
from scripts.benchmark.tracks import newest
from scripts.experiments.pictures import SCENE_SEED, TRACK_SEED
from scripts.film.footage import of_simulation
from scripts.film.render import shoot
from scripts.live.replay import Recorder
from sim.simulation import Simulation

SECONDS = 12.0
SLAM = "shunting"


def settings() -> dict[str, dict[str, Any]]:
    """Of ``Simulation``, by name of the page: tracks at their highest level, scenes at 1."""
    found = {}
    for track in newest().values():
        plan = track.plan((), (TRACK_SEED,))
        found[f"track_{track.family}"] = plan.recipe(plan.runs()[-1]).simulation()
    for name in scenes.names():
        found[f"scene_{name}"] = {"scene": name, "seed": SCENE_SEED, "dynamism": 1.0}
    return found


def main(folder: Path) -> None:
    """Make those that are missing."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, given in settings().items():
        path = folder / f"{name}.html"
        if path.exists():
            continue
        simulation = Simulation(**{**given, "labels": True})
        title = name.partition("_")[2]
        with of_simulation(simulation, seconds=SECONDS, title=title, view=None) as footage:
            show = footage.show([SLAM])
            with Recorder.of(path, show) as recorder:
                for _ in shoot(footage.stream, show, None):
                    recorder.note(show.shown)
        print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    main(parser.parse_args().folder)

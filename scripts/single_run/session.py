# SPDX-License-Identifier: Apache-2.0
"""One run from a stream to a folder: replay, film, figures, map, trajectories, scores, recipe."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
from rich.markup import escape

from scripts import figures
from scripts.console import console, working
from scripts.film import FPS
from scripts.film.encode import Pace, film, require_ffmpeg
from scripts.film.render import shoot, watched
from scripts.film.show import Show
from scripts.names import file_name
from scripts.output import machine, whole_folder, write_recipe
from scripts.single_run import score
from scripts.single_run.costs import Costs, say
from scripts.single_run.small_maps import small_changes, small_map
from slam.files import write_text
from slam.frames import EPOCH, Stream
from slam.maps import write_map
from slam.replay import Replay
from slam.trajectory import write_tum


@dataclass(frozen=True, kw_only=True)
class Outputs:
    """Where a run goes and what it leaves."""

    folder: Path
    command: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    overwrite: bool = False
    film: bool = True
    film_fps: float = FPS
    pace: Pace | None = None  # of the film; None: real time, or faster for it to last a minute


def run_session(stream: Stream, show: Show, outputs: Outputs) -> dict[str, Any]:
    """Replay ``stream``, write everything into ``outputs.folder``, print the table.

    The folder appears when it is whole. Returns what ``results.json`` holds.
    """
    replay = show.replay
    if outputs.film:
        require_ffmpeg()
    with whole_folder(
        outputs.folder,
        overwrite=outputs.overwrite,
        command=outputs.command,
        settings=outputs.settings,
    ) as folder:
        costs = Costs()
        show.pace = outputs.pace or Pace.within_a_minute(show.duration_s, outputs.film_fps)
        reel = film(folder / "film.mp4", show.pace.fps) if outputs.film else nullcontext()
        started = time.perf_counter()
        with reel as opened:
            for _ in watched(shoot(stream, show, opened), stream, show.title):
                pass
        wall_s = time.perf_counter() - started
        with costs.slam(), working("closing loops, scoring"):
            results = score.results(replay, wall_s, machine())
        with working("drawing map, paths and errors"):
            _draw(folder, replay, show, int(stream.metadata.extra.get(EPOCH, 0)))
            if opened is not None and opened.last is not None:
                imageio.imwrite(folder / "poster.png", opened.last)
        results["cost"] = costs.block(replay)
        write_text(folder / "results.json", json.dumps(results, indent=2, sort_keys=True) + "\n")
        write_recipe(folder, outputs.command, outputs.settings)
    score.print_table(results, show.title)
    say(results["cost"])
    _tell(outputs)
    return results


def _draw(folder: Path, replay: Replay, show: Show, epoch_ns: int) -> None:
    """Maps, trajectories and their pictures."""
    online = {name: track.online() for name, track in replay.tracks.items()}
    world_truth = replay.truth()
    truth = figures.in_first_frame(world_truth) if world_truth is not None else None
    primary = replay.tracks[show.primary]
    raster = primary.map()
    truth_name = show.truth_name
    for name, track in online.items():
        write_tum(folder / f"trajectory_{file_name(name)}.tum", track, epoch_ns)
        final = replay.tracks[name].final()
        if final is not None:
            write_tum(folder / f"trajectory_{file_name(name)}_final.tum", final, epoch_ns)
    if truth is not None:
        write_tum(folder / "trajectory_truth.tum", truth, epoch_ns)
        figures.errors(folder / "errors.png", online, truth)
    small = None
    if raster is not None:
        write_map(folder / "map", show.seen.merge(raster))
        small = small_map(raster)
        del raster  # a large one has its gigabyte
    figures.trajectories(folder / "trajectories.png", online, truth, small, truth_name)
    own, changes_png = online[show.primary], folder / "changes.png"
    if small is not None:
        figures.map_picture(folder / "map.png", small, own, show.last_points_map)
    primary.save(folder / "map.npz")
    changes = primary.changes()
    if small is not None and changes is not None:
        figures.changes_picture(changes_png, small, small_changes(changes), own)


_WORTH_OPENING = ("film.mp4", "map.png", "changes.png", "trajectories.png", "errors.png")


def _tell(outputs: Outputs) -> None:
    """What to open first, of what is really there."""
    there = [name for name in _WORTH_OPENING if (outputs.folder / name).exists()]
    others = ["results.json has every number", "trajectory_*.tum is for evo"]
    if (outputs.folder / "map.yaml").exists():
        others.append("map.yaml for map_server")
    if (outputs.folder / "map.npz").exists():
        others.append("map.npz for the SLAM's load()")
    first = escape(str(outputs.folder / there[0]))
    then = f", then {', '.join(there[1:])} beside it" if there[1:] else ""
    console.print(f"Open [bold]{first}[/bold] first{then}; {', '.join(others)}.", soft_wrap=True)

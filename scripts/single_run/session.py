# SPDX-License-Identifier: Apache-2.0
"""One run from a stream to a folder: replay, film, figures, map, trajectories, scores, recipe."""

import json
import math
import os
import resource
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np
from rich.markup import escape
from rich.table import Table

from scripts import figures
from scripts.console import console, note, say, working
from scripts.film import FPS
from scripts.film.encode import Pace, film, require_ffmpeg
from scripts.film.render import Liveliest, shoot, watched
from scripts.film.show import Show
from scripts.live.replay import Recorder
from scripts.machine import machine
from scripts.metrics.judged import Judged, in_first_frame, moved
from scripts.names import file_name, scene_name
from scripts.output import write_recipe
from scripts.pages import page as pages
from scripts.pages.page import Page, Part
from scripts.single_run import score
from scripts.spec import command_line
from scripts.whole_folder import whole_folder
from sim.view.draw import Picture
from slam.errors import InvalidValueError
from slam.estimate import Changes, Raster
from slam.evaluation.consistency import KeptScans
from slam.files import write_text
from slam.frames import EPOCH, Stream
from slam.frontend.seen_space import SeenSpace
from slam.maps import write_map
from slam.names import is_code
from slam.rasters import joined, known
from slam.replay import Replay, Track
from slam.tracker.tracker import Tracker
from slam.trajectory import Trajectory, write_tum

MOST_PIXELS = 1 << 26  # of map.pgm: a square of 245 m at 3 cm, which a map_server holds as 67 MB
MOST_CELLS = 800  # along the longer side; a picture of a map drops cells where it has more


@dataclass(frozen=True, eq=False)
class Drawn:
    """What is known of a map; that and its changes as pictures show them."""

    cells: Raster
    map: Raster
    changes: Changes | None


def drawn(track: Track, most: int = MOST_CELLS) -> Drawn | None:
    """What is known of a track's map in at most ``most`` cells along its longer side, each the
    largest of several: a thin wall stays. None where nothing is known.

    Raises as ``Track.map`` does.
    """
    raster = track.map()
    part = None if raster is None else known(raster)
    if raster is None or part is None:
        return None
    cells = joined(raster, 1, part)
    n = max(-(-max(cells.values.shape) // most), 1)
    changes = track.changes()
    if changes is not None:
        appeared, gone = (
            joined(layer, n, part if layer.values.shape == raster.values.shape else None)
            for layer in (changes.appeared, changes.gone)
        )
        changes = Changes(appeared=appeared, gone=gone)
    return Drawn(cells, joined(cells, n), changes)


def for_file(cells: Raster, seen: SeenSpace) -> tuple[Raster, str]:
    """A map with the space that was seen, such that it fits into one image file, and what to say
    where its cells had to be joined."""
    fitting = seen.merge(cells, MOST_PIXELS)
    if fitting.resolution_m == cells.resolution_m:
        return fitting, ""
    height, width = (fitting.resolution_m * n for n in fitting.values.shape)
    return fitting, (
        f"map.pgm has cells of {fitting.resolution_m:g} m instead of {cells.resolution_m:g} m: "
        f"the map is {width:.0f} m x {height:.0f} m, and the image has {MOST_PIXELS} cells at most."
    )


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


# What the colours of the pictures mean.
MAP_LEGEND = {"#800026": "stands there for long", "#fd8d3c": "seen lately, or now and then",
              "#fafaf8": "empty or never seen", "#1f61be": "the last scan"}  # fmt: skip
CHANGES_LEGEND = {"#238b45": "new: seen, hardly in long-term memory",
                  "#cb181d": "gone: in long-term memory, seen empty",
                  "#888": "as before"}  # fmt: skip
_RSS_BYTES = 1 if sys.platform == "darwin" else 1024  # bytes, unit of ru_maxrss: getrusage(2)
Writer = Callable[[Path, Show], None]
_files: dict[str, Writer] = {}


def run_file(name: str) -> Callable[[Writer], Writer]:
    """Register a function that writes the file ``name`` of every run.

    It gets the path to write to, and the ``Show`` after the last frame.
    """

    def decorate(write: Writer) -> Writer:
        if Path(name).name != name or _files.setdefault(name, write) is not write:
            raise InvalidValueError(f"a file of a run must have a name of its own, got '{name}'")
        return write

    return decorate


def run_session(stream: Stream, show: Show, outputs: Outputs) -> dict[str, Any]:
    """Replay ``stream``, write everything into ``outputs.folder``, print the table.

    The folder appears when it is whole. Returns what ``results.json`` holds.
    """
    before_s, settings = _spent_s(), outputs.settings
    if outputs.film:
        require_ffmpeg()
    with whole_folder(
        outputs.folder, overwrite=outputs.overwrite, command=outputs.command, settings=settings
    ) as folder:
        started = time.perf_counter()
        played = play(folder, stream, show, outputs)
        wall_s = time.perf_counter() - started
        with working("closing loops, scoring"):
            results = score.results(show.replay, wall_s, machine(), played.kept)
        with working("writing map and paths"):
            _write_paths(folder, show.replay, int(stream.metadata.extra.get(EPOCH, 0)))
            in_pictures = _write_map(folder, show)
        with working("drawing map, paths and errors"):
            _draw(folder, show, in_pictures)
            if played.last is not None:
                framed = None if in_pictures is None else show.poster(in_pictures.map)
                poster = next(p for p in (framed, played.liveliest, played.last) if p is not None)
                imageio.imwrite(folder / "poster.png", poster)
        for name, write in _files.items():
            write(folder / name, show)
        results["cost"] = cost = _cost(show.replay, _spent_s() - before_s)
        write_text(folder / "results.json", json.dumps(results, indent=2, sort_keys=True) + "\n")
        write_recipe(folder, outputs.command, outputs.settings)
        table = score.table(results, show.title)
        page = _page(outputs, show, results, table)
        pages.write(folder, page)
    console.print(table)
    spent = (
        f"Processor time: {cost['slam_s']:.0f} s of SLAM, {cost['rest_s']:.0f} s of all else; "
        f"memory at most {cost['memory_mb']} MB."
    )
    agreed = "" if "scene" in outputs.settings else score.agreement_words(results)
    for words in filter(None, (agreed, spent)):
        say(escape(words), highlight=False)
    pages.tell(outputs.folder, page)
    return results


@dataclass(frozen=True, eq=False)
class Played:
    """What was kept on the way: scans, and of a film its last picture and that of its liveliest
    second."""

    kept: KeptScans
    last: Picture | None = None
    liveliest: Picture | None = None


def play(folder: Path, stream: Stream, show: Show, outputs: Outputs) -> Played:
    """Run through the stream; film and record it where that is wanted."""
    show.pace = pace = outputs.pace or Pace.within_a_minute(show.duration_s, outputs.film_fps)
    kept, liveliest = KeptScans(), Liveliest(show.duration_s / 3.0)
    with ExitStack() as stack:
        reel = recording = None
        if outputs.film:
            reel = stack.enter_context(film(folder / "film.mp4", pace.fps, preset=pace.preset))
            recording = stack.enter_context(Recorder.of(folder / "replay.html", show))
        for frame in watched(shoot(stream, show, reel), stream, show.title):
            kept.note(frame, show.track().estimates[-1].T_map_robot)
            if recording is not None and reel is not None and show.shown is not None:
                liveliest.note(frame, show.shown.seconds, reel.last)
                recording.note(show.shown)
    return Played(kept, None if reel is None else reel.last, liveliest.picture)


def _cost(replay: Replay, spent_s: float) -> dict[str, Any]:
    """For ``results.json``: s of processor time of all updates and of all else, and MB."""
    updates_s = (s for track in replay.tracks.values() for s in track.durations_s)
    slam_s = sum(s for s in updates_s if math.isfinite(s))
    most_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _RSS_BYTES / 1e6
    rest_s = max(spent_s - slam_s, 0.0)
    return {"slam_s": round(slam_s, 1), "rest_s": round(rest_s, 1), "memory_mb": round(most_mb)}


def _spent_s() -> float:
    """s of this process and of those that it started and that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _write_paths(folder: Path, replay: Replay, epoch_ns: int) -> None:
    paths = {"truth": _truth(replay)}
    for name, track in replay.tracks.items():
        paths |= {file_name(name): track.online(), f"{file_name(name)}_final": track.final()}
    for name, path in paths.items():
        if path is not None:
            write_tum(folder / f"trajectory_{name}.tum", path, epoch_ns)


def _truth(replay: Replay) -> Trajectory | None:
    world_truth = replay.truth()
    return None if world_truth is None else in_first_frame(world_truth)


def _write_map(folder: Path, show: Show) -> Drawn | None:
    """The map for a map_server and the SLAM's own; what pictures show of it, where it has one."""
    primary = show.track()
    found = drawn(primary)
    if found is not None:
        cells, said = for_file(found.cells, show.seen)
        write_map(folder / "map", cells)
        if said:
            note(said)
    primary.save(folder / "map.npz")
    return found


def _draw(folder: Path, show: Show, found: Drawn | None) -> None:
    """Trajectories, errors, the map and what changed in it."""
    online = {name: track.online() for name, track in show.replay.tracks.items()}
    truth = _truth(show.replay)
    if truth is not None:
        figures.errors(folder / "errors.png", online, truth)
    T_map_first = getattr(show.track().system, "T_map_first", np.zeros(3))  # of a session
    online = {name: moved(path, T_map_first) for name, path in online.items()}
    truth, own = truth and moved(truth, T_map_first), online[show.primary]
    raster = None if found is None else found.map
    figures.trajectories(
        folder / "trajectories.png", online, truth, raster, show.moments.truth_name
    )
    if found is None:
        return
    figures.map_picture(folder / "map.png", found.map, own, show.last_points_map)
    if found.changes is not None:
        figures.changes_picture(folder / "changes.png", found.map, found.changes, own)


def _page(outputs: Outputs, show: Show, results: Mapping[str, Any], table: Table) -> Page:
    """What the run's page says."""
    parts = [
        Part(title="Map", picture="map.png", legend=MAP_LEGEND),
        Part(title="What changed", picture="changes.png", legend=CHANGES_LEGEND),
        Part(title="Paths", picture="trajectories.png"),
        Part(title="Error over time", picture="errors.png"),
        Part(title="Numbers", table=table),
    ]
    settings = {key: value for key, value in outputs.settings.items() if key != "log_facts"}
    said = score.said(results, show.primary, show.moments.truth_name)
    return Page(
        title=show.title, said=said, parts=parts,
        next=_next(outputs, show), settings=settings,
    )  # fmt: skip


def _next(outputs: Outputs, show: Show) -> dict[str, str]:
    """What to do with the run."""
    folder, settings, slam = outputs.folder, outputs.settings, show.primary
    if "scene" not in settings:
        if not isinstance(show.track().system, Tracker):  # no other goes on in a map
            return {}
        maps = {"map_in": folder / "map.npz", "map_out": "NEXT.npz"}
        return {"Go on in this map:": command_line("run", slam=slam, log="LOG", **maps)}
    scene, scanner = settings["scene"], settings.get("laser", "full")
    then = {}
    if not {"also_at", "cut"} & {*settings}:  # of these there is no going back
        trust = is_code(slam) or is_code(scene)
        then["What misled it, if anything did:"] = command_line("blame", folder=folder, trust=trust)
        if Judged.of(show.track(), show.replay.truth()).lost_s is not None:
            short = command_line("shrink", folder=folder, trust=trust)
            then["In how little of this run is it lost again?"] = short
    then["From how much motion on is it lost?"] = command_line(
        "compare", slam=slam, scene=scene, dynamism="0:1:0.5", seeds=6,
        scanner=None if scanner == "full" else scanner, out=f"out/compare-{scene_name(scene)}",
    )  # fmt: skip
    then["Drive and disturb it yourself:"] = command_line("live", scene=scene, slam=slam)
    return then

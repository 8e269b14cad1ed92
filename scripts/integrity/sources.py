# SPDX-License-Identifier: Apache-2.0
"""Which streams weights are fitted on, and their labelled scans in files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from scripts import workers
from scripts.comparison.recording import load
from scripts.experiments.recorded import make_missing
from scripts.experiments.verdict_tracks import Stream
from scripts.integrity import labelled as labelling
from scripts.integrity.labelled import Labelled, labelled
from scripts.integrity.plane import KINDS, StreamSpec, frames
from scripts.integrity.settling import code
from scripts.integrity.ways import DECIDABLE
from slam.files import make_folder, write_text
from slam.frames import Frame
from slam.logs import open_log
from slam.shunting import ShuntingSlam

TRACKS = (
    "moving-day", "overnight", "warehouse-shift", "kidnapped-in-a-crowd", "moving-boards",
    "busy-chairs",
)  # fmt: skip
PLANES = ("chairs16", "pass6", "crowd6", "moved30", "wide270", "poor")
LEVEL = 1.0  # of the tracks
SECONDS = 150.0  # of a stream of the plane
MOST_SCANS = 2000  # of a log
Source = Stream | StreamSpec | Path
"""A track, a stream of the plane, or the log of a real robot."""


def name_of(source: Source) -> str:
    """Of a stream, as files and tables call it."""
    if isinstance(source, Stream):
        return source.name
    if isinstance(source, Path):
        return f"log-{source.name.partition('.')[0]}"
    return f"plane-{source.kind}_s{source.seed}"


def building_of(source: Source) -> str:
    """Streams with another one were made in other rooms."""
    if isinstance(source, Stream):
        return str(source.simulated()["scene"])
    return name_of(source) if isinstance(source, Path) else source.settings.layout


def frames_of(source: Source, folder: Path) -> Sequence[Frame]:
    """Simulated, from its recording in ``folder``, or of a log where a first pass saw it."""
    if isinstance(source, Stream):
        return load(source.path(folder)).frames
    if isinstance(source, StreamSpec):
        return frames(source)
    log = [frame for frame in open_log(source) if frame.scan is not None][:MOST_SCANS]
    slam = ShuntingSlam()
    return [replace(frame, truth=slam.update(frame.without_truth()).T_map_robot) for frame in log]


def sources(names: Sequence[str], seeds: Sequence[int]) -> list[Source]:
    """The training streams of these tracks and kinds of the plane."""
    tracks = [name for name in TRACKS if name in names]
    planes = [name for name in PLANES if name in names]
    out: list[Source] = []
    for seed in seeds:
        out += [Stream(track=track, level=LEVEL, seed=seed) for track in tracks]
        out += [_plane(kind, seed) for kind in planes]
    return out


def _plane(kind: str, seed: int) -> StreamSpec:
    """In rooms of which no two are alike: where they are, nothing tells the right place."""
    layout = DECIDABLE[(seed + list(KINDS).index(kind)) % len(DECIDABLE)]
    return StreamSpec(kind=kind, seed=seed, seconds=SECONDS, changes=(("layout", layout),))


def with_others(all_: Sequence[Source]) -> list[tuple[Source, Source]]:
    """Each with the next one that was made in other rooms."""
    rooms = [building_of(one) for one in all_]
    pairs = []
    for k, one in enumerate(all_):
        after = [n % len(all_) for n in range(k + 1, k + len(all_))]
        other = next((n for n in after if rooms[n] != rooms[k]), k)
        pairs.append((one, all_[other]))
    return pairs


def collected(all_: Sequence[Source], folder: Path, jobs: int) -> list[Labelled]:
    """The labelled scans of all, in order; those of the same code are kept in ``folder``."""
    make_missing([one for one in all_ if isinstance(one, Stream)], folder, jobs)
    make_folder(folder)
    pairs = with_others(all_)
    missing = [pair for pair in pairs if _kept(pair, folder) is None]
    for one in workers.each(partial(_collect, folder=folder), missing, jobs=jobs):
        print(f"labelled {name_of(one)}", flush=True)
    kept = [_kept(pair, folder) for pair in pairs]
    return [one for one in kept if one is not None]


def _collect(pair: tuple[Source, Source], folder: Path) -> Source:
    own, other = (frames_of(source, folder) for source in pair)
    row = {"digest": _digest(pair), **asdict(labelled(name_of(pair[0]), own, other))}
    write_text(_path(pair, folder), json.dumps(row) + "\n")
    return pair[0]


def _kept(pair: tuple[Source, Source], folder: Path) -> Labelled | None:
    try:
        row = json.loads(_path(pair, folder).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(row, dict) or row.pop("digest", "") != _digest(pair):
        return None
    return Labelled(**row)


def _path(pair: tuple[Source, Source], folder: Path) -> Path:
    return folder / f"{name_of(pair[0])}.json"


def _digest(pair: tuple[Source, Source]) -> str:
    own = Path(labelling.__file__).read_bytes()
    words = [code(), hashlib.sha256(own).hexdigest(), *(repr(one) for one in pair)]
    return hashlib.sha256(json.dumps(words).encode()).hexdigest()

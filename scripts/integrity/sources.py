# SPDX-License-Identifier: Apache-2.0
"""Which streams weights are fitted on, and their labelled scans in files."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from scripts.benchmark.tracks import chosen
from scripts.comparison.recording import load
from scripts.experiments.study import on_track, recorded
from scripts.integrity.campaign import PLANE
from scripts.integrity.labelled import Labelled, labelled
from scripts.integrity.plane import KINDS, StreamSpec, frames
from scripts.integrity.ways import DECIDABLE
from scripts.jobs import Job, run_jobs
from scripts.result_files import ROOT
from slam.files import write_text
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
CODE = (
    ROOT / "slam", *PLANE,
    *(ROOT / "scripts" / "integrity" / f"{name}.py" for name in ("kidnap", "labelled")),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Stream:
    """A track at a level with a seed."""

    track: str
    level: float
    seed: int

    def simulated(self) -> Job:
        """The job that records it."""
        every = chosen([self.track])[0].every
        return recorded({"every": every, **on_track(self.track, self.level, self.seed)})


Source = Stream | StreamSpec | Path
"""A track, a stream of the plane, or the log of a real robot."""


def name_of(source: Source) -> str:
    """Of a stream, as files and tables call it."""
    if isinstance(source, Stream):
        return f"{source.track}_{source.level:g}_s{source.seed}"
    if isinstance(source, Path):
        return f"log-{source.name.partition('.')[0]}"
    return f"plane-{source.kind}_s{source.seed}"


def building_of(source: Source) -> str:
    """Streams with another one were made in other rooms."""
    if isinstance(source, Stream):
        return str(source.simulated().arguments["scene"])
    return name_of(source) if isinstance(source, Path) else source.settings.layout


def frames_of(source: Source, folder: Path) -> Sequence[Frame]:
    """Simulated, from its recording in ``folder``, or of a log where a first pass saw it."""
    if isinstance(source, Stream):
        return load(folder / source.simulated().file_name()).frames
    if isinstance(source, StreamSpec):
        return frames(source)
    log = [frame for frame in open_log(source) if frame.scan is not None][:MOST_SCANS]
    slam = ShuntingSlam()
    return [replace(frame, truth=slam.update(frame.without_truth()).T_map_robot) for frame in log]


def sources(names: Sequence[str], seeds: Sequence[int]) -> list[Source]:
    """The training streams of these tracks and kinds of the plane."""
    out: list[Source] = []
    for seed in seeds:
        out += [Stream(track=one, level=LEVEL, seed=seed) for one in TRACKS if one in names]
        out += [_plane(kind, seed) for kind in PLANES if kind in names]
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
    drives = [one.simulated() for one in all_ if isinstance(one, Stream)]
    run_jobs(drives, folder, processes=jobs, title="drives")
    wanted = [
        Job(
            name=name_of(own),
            call=label,
            arguments={"own": _told(own), "other": _told(other), "folder": str(folder)},
            suffix=".json",
            code=(*CODE, *(one for one in (own, other) if isinstance(one, Path))),
        )
        for own, other in with_others(all_)
    ]
    files = run_jobs(wanted, folder, processes=jobs, title="labelling scans")
    return [Labelled(**json.loads(files[one.name].read_text())) for one in wanted]


def label(path: Path, *, own: dict[str, Any], other: dict[str, Any], folder: str) -> None:
    """Write the labelled scans of a source; ``other`` gives the scans with no place."""
    one = _source(own)
    streams = [frames_of(source, Path(folder)) for source in (one, _source(other))]
    write_text(path, json.dumps(asdict(labelled(name_of(one), *streams))) + "\n")


def _told(source: Source) -> dict[str, Any]:
    """As JSON has it: ``_source`` makes it again."""
    if isinstance(source, Path):
        return {"log": str(source)}
    return {"track" if isinstance(source, Stream) else "plane": asdict(source)}


def _source(told: dict[str, Any]) -> Source:
    ((what, of),) = told.items()
    if what == "log":
        return Path(of)
    return Stream(**of) if what == "track" else StreamSpec(**of)

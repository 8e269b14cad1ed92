# SPDX-License-Identifier: Apache-2.0
"""The runs of a gate: recordings of tracks, kept by their digest, and a SLAM on each of them.

The recordings are a cache. A SLAM runs anew each time: what it is made of, a library say, is not
all known to us.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

from scripts import interrupt, workers
from scripts.benchmark import submission
from scripts.benchmark.runs_file import At, Made, Results, Row, checked_name
from scripts.benchmark.tracks import TRACKS, Track, chosen
from scripts.comparison import recording
from scripts.comparison.plan import RECORDINGS
from scripts.console import progress
from scripts.jobs import Job
from scripts.names import file_name
from scripts.report.answer import ODOMETRY
from scripts.spec import command_line
from sim.recording.recipe import Recipe
from sim.recording.sums import damage_beside, write_beside
from slam.errors import InvalidValueError, SlamFailedError
from slam.files import replacing
from slam.frames import BeamClass

USUAL = ("busy-chairs", "rush-hour", "classroom-break")  # tracks: a flat, a hall, a classroom
LEVEL, SEEDS, SECONDS = 0.5, 20, 20.0  # of them, where nothing else is asked for; s of a run
FIRST = 3  # where a SLAM fails in all of the first runs, there is nothing to compare


@dataclass(frozen=True, kw_only=True)
class One:
    """One run: a track at a level with a seed; ``job`` makes its recording."""

    track: str
    at: At
    recipe: Recipe
    every: int
    job: Job

    @classmethod
    def of(cls, track: Track, at: At, seconds: float | None) -> "One":
        """``seconds`` None: as long as the track says; raises as ``Track.plan``."""
        level, seed = at
        plan = track.plan((ODOMETRY,), (seed,), levels=(level,), seconds=seconds, oracles=False)
        (run,) = plan.runs()
        job = plan.recordings()[run.name]
        return cls(
            track=track.name, at=at, recipe=plan.recipe(run), every=plan.every,
            job=replace(job, name=f"{track.name}_{run.name}"),
        )  # fmt: skip

    def __str__(self) -> str:
        return f"{self.track}, level {self.at[0]:g}, seed {self.at[1]}"

    def blame(self, slam: str) -> str:
        """The command that runs it again, and says what misled the SLAM."""
        recipe = self.recipe
        given = {**recipe.options, "odometry": recipe.odometry, "moving_share": recipe.moving_share}
        given |= {"change_at_s": recipe.change_at_s, "kidnap_every_s": recipe.kidnap_every_s}
        crowd, near = given.pop("crowd", None), recipe.range_mode
        scanner = recipe.scanner if near == "80m" else f"lms221(range_mode={near}):{recipe.scanner}"
        return command_line(
            "blame", slam=slam, scene=recipe.scene, dynamism=recipe.dynamism, motion=recipe.motion,
            change=recipe.change, crowd=crowd, seed=recipe.seed, seconds=recipe.seconds,
            scanner=scanner, every=self.every,
            scene_option=[f"{name}={value}" for name, value in given.items() if value is not None],
        )  # fmt: skip


def of_tracks(
    tracks: Sequence[str] = USUAL,
    level: float = LEVEL,
    seeds: int = SEEDS,
    seconds: float = SECONDS,
) -> list[One]:
    """The first of each track's seeds for tuning, turn by turn; those that count stay unused."""
    known = chosen(tracks)
    most = min(len(track.train) for track in known)
    if not 1 <= seeds <= most:
        raise InvalidValueError(f"seeds must be 1 to {most}, got {seeds}")
    return [
        One.of(track, (level, track.train[k]), seconds) for k in range(seeds) for track in known
    ]


def of_results(saved: Results) -> list[One]:
    """Those of saved results, the tracks by turns."""
    turns = (
        [One.of(TRACKS[name], at, saved.seconds) for at in sorted(runs, key=lambda at: at[::-1])]
        for name, runs in saved.runs.items()
    )
    return [one for one in chain.from_iterable(zip_longest(*turns)) if one is not None]


def recorded(job: Job, folder: Path) -> Path:
    """The file of a recording in ``folder``; made where it is missing or damaged."""
    file = folder / job.file_name()
    if not file.exists() or damage_beside(file):
        with replacing(file) as temporary:
            job.call(temporary, **job.arguments)
            write_beside(file, temporary)
    return file


def _ran(item: tuple[int, Job, Path, str]) -> tuple[int, str, Row]:
    """In a worker: the number of a run, the digest of its recording, and its row."""
    number, job, folder, slam = item
    file = recorded(job, folder)
    drive = recording.load(file)
    row, arrays = submission.alone(slam, drive)
    row |= {"moving_share_of_returns": drive.share_of_returns(BeamClass.MOVING)}
    poses = submission.digest_of(arrays["stamps_ns"], arrays["poses"])
    return number, recording.digest(file), submission.run_of(row, poses)


def carried_out(
    runs: Sequence[One], slam: str, out: Path, **ways: Any
) -> Generator[tuple[One, str, Row]]:
    """Each run in its order, with the digest of its recording and its row; who has seen enough of
    them stops. ``ways`` as ``scripts.workers.each`` has them.

    Raises ``SlamFailedError`` where the SLAM fails in all of the ``FIRST`` runs.
    """
    items = [(k, one.job, out / RECORDINGS, slam) for k, one in enumerate(runs)]
    done: dict[int, tuple[str, Row]] = {}
    given = 0
    with progress() as bar:
        task = bar.add_task("runs", total=len(runs), unit="")
        for k, digest, row in workers.each(_ran, items, shared=out, **ways):
            interrupt.check()
            done[k] = digest, row
            bar.update(task, completed=len(done), unit=f"{len(done)}/{len(runs)}")
            while given in done:  # in order, whatever the workers do: the verdict hangs on it
                given += 1
                failed = [row["failure"] for _, row in (done[k] for k in range(given))]
                if given == min(FIRST, len(runs)) and all(failed):
                    raise SlamFailedError(str(failed[0]))
                yield runs[given - 1], *done[given - 1]


def results_of(slam: str, seconds: float, made: Sequence[tuple[One, str, Row]]) -> Results:
    """For a file: a submission to the benchmark, of these tracks alone."""
    name = name_of(slam)
    runs: dict[str, Made] = {}
    for one, digest, row in made:
        runs.setdefault(one.track, {})[one.at] = (digest, {name: row})
    return Results(
        name=name, slam=slam, seconds=seconds, runs=runs, made_with=submission.made_with(slam)
    )


def name_of(slam: str) -> str:
    """What saved results call it; ``InvalidValueError`` where they cannot hold it."""
    return checked_name(file_name(slam)[:40], slam)

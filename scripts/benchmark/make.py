# SPDX-License-Identifier: Apache-2.0
"""The benchmark as a whole: a comparison for each track, and the leaderboard of all of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.benchmark import days, published, submission
from scripts.benchmark.board import Board
from scripts.benchmark.published import Published
from scripts.benchmark.sealed import SealedSeeds
from scripts.benchmark.submission import Submission
from scripts.benchmark.tracks import LEVELS, QUICK_LEVELS, TEST, TRACKS, TRAIN, Track
from scripts.comparison.folder import Compared
from scripts.comparison.make import carry_out as compare
from scripts.comparison.plan import Plan
from scripts.console import note
from scripts.days.buildings import DAYS, Buildings
from scripts.days.buildings import carry_out as live
from scripts.days.scores import Row
from scripts.machine import machine, versions
from scripts.output import result_folder
from sim.core.versions import WORLD
from slam import system
from slam.errors import InvalidValueError, MissingDependencyError

COMMAND = "benchmark"
SEEDS, QUICK_SEEDS = 6, 1
Digests = dict[str, dict[tuple[float, int], str]]  # of recordings, by track, level and seed
Runs = dict[str, list[dict[str, Any]]]  # rows of runs.csv by track


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is to be run.

    slams    beside the controls of each track; the subject is one of them
    train    on the seeds that are for tuning, not on those that count
    sealed   on these seeds instead
    seeds    how many
    quick    three levels only: runs of the full benchmark, which goes on from there
    seconds  of each run, instead of the track's own; such a board is for trying out
    submit   name of a submission to write of the subject's runs
    missing  SLAMs that would run too if they were installed, and how to get them
    days     also in buildings that go on over sessions (``scripts.benchmark.days``)
    """

    tracks: tuple[Track, ...]
    slams: tuple[str, ...]
    subject: str
    train: bool = False
    sealed: SealedSeeds | None = None
    seeds: int = SEEDS
    quick: bool = False
    seconds: float | None = None
    submit: str | None = None
    missing: Mapping[str, str] = field(default_factory=dict)
    days: bool = False

    def __post_init__(self) -> None:
        if self.submit is not None:
            submission.checked_name(self.submit, self.subject)
        if self.subject not in self.slams:
            raise InvalidValueError(f"the subject {self.subject!r:.80} is none of the SLAMs")
        if self.sealed is not None:
            self.sealed.check_for(self.tracks)
        most = min(len(self.seeds_of(track)) for track in self.tracks)
        if not 1 <= self.seeds <= most:
            raise InvalidValueError(f"--seeds must be 1 to {most}, got {self.seeds}")
        if self.days:
            self.buildings()  # complains of what cannot be

    @property
    def levels(self) -> tuple[float, ...]:
        """Of every track."""
        return QUICK_LEVELS if self.quick else LEVELS

    def seeds_of(self, track: Track) -> tuple[int, ...]:
        """All that there are of that kind."""
        if self.sealed is not None:
            return self.sealed.seeds
        return track.train if self.train else track.test

    def plan(self, track: Track, oracles: bool = True) -> Plan:
        """The comparison of a track, with its oracles or without."""
        seeds = self.seeds_of(track)[: self.seeds]
        return track.plan(
            self.slams, seeds, levels=self.levels, seconds=self.seconds, oracles=oracles
        )

    @property
    def public(self) -> bool:
        """Whether these are runs that can have been published."""
        return not self.train and self.sealed is None and self.seconds is None

    def buildings(self) -> Buildings:
        """Of the section over days."""
        known = self.sealed.seeds if self.sealed else TRAIN if self.train else TEST
        return days.buildings(
            self.slams, known[: self.seeds], quick=self.quick, seconds=self.seconds
        )

    def head(self) -> dict[str, Any]:
        """What a leaderboard says of how it was made."""
        each = (k for track in self.tracks for k in self.seeds_of(track)[: self.seeds])
        seeds = list(dict.fromkeys(each))
        return {
            "tracks_run": [track.name for track in self.tracks],
            "seeds_of": submission.SEALED if self.sealed else submission.SETS[self.train],
            "seeds": seeds,
            "levels_run": list(self.levels),
            "quick": self.quick,
            "seconds": self.seconds,
            "slams": list(self.slams),
            "world": WORLD,
        }


def wanted_of(
    tracks: tuple[Track, ...], slams: Sequence[str], subject: str | None, **settings: Any
) -> Wanted:
    """With the defaults filled in: all SLAMs that are installed where none is named.

    The subject is the one given, else the first SLAM named, else "shunting". A quick run has no
    others unless they are named.
    """
    named, missing = tuple(slams), dict[str, str]()
    first = subject or (named[0] if named else "shunting")
    if not named and not settings.get("quick"):
        named, missing = installed()
    every = tuple(dict.fromkeys((first, *named)))
    return Wanted(tracks=tracks, slams=every, subject=first, missing=missing, **settings)


def carry_out(
    wanted: Wanted,
    out: Path,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    merge: Sequence[Submission] = (),
    shared: Published | None = None,
) -> Board:
    """Make what is missing in ``out``, a folder of ``compare`` for each track; the leaderboard.

    merge   submissions of others: they get rows beside those that ran here
    shared  runs of others on public seeds, beside those on the very same recordings; oracles that
            are among them do not run

    Raises ``InvalidValueError`` for a submission that ran on other scans.
    """
    shared = shared if wanted.public else None
    plans = plans_of(wanted, shared)  # all, before any is made
    _check_alike(merge, wanted, {name for plan in plans.values() for name in plan.slams})
    out = out.absolute()
    settings = {**wanted.head(), "machine": machine()}
    with result_folder(out, COMMAND, settings) as written:
        runs: Runs = {}
        for name, plan in plans.items():
            note(f"{name}: {TRACKS[name].about}")
            runs[name] = compare(plan, out / name, jobs=jobs, cluster=cluster)
        digests = {name: published.digests(plan, out / name) for name, plan in plans.items()}
        lives = wanted.buildings() if wanted.days else None
        aged = [] if lives is None else live(lives, out / DAYS, jobs=jobs, cluster=cluster)
        own = None if wanted.submit is None else _submission(wanted, runs, digests, out)
        for one in merge:
            for name in plans:
                runs[name] = runs[name] + _on_the_same_scans(one, name, digests[name])
        if shared is not None:
            _told_of_others(shared, digests)
            for name in plans:
                there = {row["slam"] for row in runs[name]}
                runs[name] = runs[name] + shared.rows(name, digests[name], tuple(there))
        with written() as staged:
            made = _board(wanted, runs, merge, aged)
            made.write(staged)
            if lives is not None:
                days.write(staged, days.head(lives), aged)
            if own is not None:
                submission.write(staged / submission.file_of(own.name), own)
    return made


def plans_of(wanted: Wanted, shared: Published | None) -> dict[str, Plan]:
    """The comparison of each track by name, without the oracles whose runs ``shared`` has."""
    shared = shared if wanted.public else None
    return {
        track.name: wanted.plan(track, shared is None or not _has_oracles(shared, wanted, track))
        for track in wanted.tracks
    }


def _has_oracles(shared: Published, wanted: Wanted, track: Track) -> bool:
    asked = [(run.dynamism, run.seed) for run in wanted.plan(track).runs()]
    return all(shared.has(track.name, asked, oracle) for oracle in track.oracles)


def _told_of_others(shared: Published, digests: Digests) -> None:
    """A note where the recordings here are others than the published ones."""
    here = sum(map(len, digests.values()))
    if others := sum(shared.others(name, own) for name, own in digests.items()):
        note(
            f"{others} of {here} recordings are others here than those of the published runs (made "
            "by another version of MuJoCo or NumPy, or on another kind of processor): the SLAMs "
            "published have no rows there. --slam YOURS A B C runs them here"
        )


def _board(wanted: Wanted, runs: Runs, merge: Sequence[Submission], aged: Sequence[Row]) -> Board:
    head = {**wanted.head(), "versions": versions(), "machine": machine()}
    return Board(
        subject=wanted.subject, head=head, tracks=wanted.tracks, runs=runs, missing=wanted.missing,
        merged={one.name: one.origin() for one in merge},
        days=days.summary(aged), days_page=days.section(aged) if aged else "",
    )  # fmt: skip


def _submission(wanted: Wanted, runs: Runs, digests: Digests, out: Path) -> Submission:
    kept: Runs = {}
    for track, rows in runs.items():
        compared, own = Compared(out / track), [r for r in rows if r["slam"] == wanted.subject]
        kept[track] = [
            submission.run_of(
                row, digests[track][row["dynamism"], row["seed"]],
                _poses(compared, row, wanted.subject),
            )
            for row in own
        ]  # fmt: skip
    head, name = wanted.head(), wanted.submit
    assert name is not None
    return Submission(
        name=name, slam=wanted.subject, seeds_of=head["seeds_of"], seeds=tuple(head["seeds"]),
        levels=wanted.levels, seconds=wanted.seconds, runs=kept,
        made_with=submission.made_with(wanted.subject),
    )  # fmt: skip


def _poses(compared: Compared, row: Mapping[str, Any], slam: str) -> str:
    """Digest of what it said in that run."""
    said = compared.run(row["scene"], row["dynamism"], row["seed"]).believed(slam)
    return submission.digest_of(said.stamps_ns, said.poses)


def _check_alike(merge: Sequence[Submission], wanted: Wanted, taken: set[str]) -> None:
    """``InvalidValueError`` for one that did not run what is to be run here, or is called alike."""
    head, of = wanted.head(), {track.name: wanted.seeds_of(track) for track in wanted.tracks}
    for one in merge:
        shared = [track for track in one.runs if track in of]
        if not shared:
            raise InvalidValueError(
                f"submission {one.name!r}: the board has none of its tracks: {', '.join(one.runs)}"
            )
        pairs = [
            ("kind of seeds", one.seeds_of, head["seeds_of"]),
            ("levels", one.levels, wanted.levels), ("seconds", one.seconds, wanted.seconds),
        ]  # fmt: skip
        for track in shared:
            ran = {run["seed"] for run in one.runs[track]}
            theirs = tuple(seed for seed in one.seeds if seed in ran)
            pairs.append((f"seeds of {track}", theirs, of[track][: wanted.seeds]))
        for what, a, b in pairs:
            if a != b:
                raise InvalidValueError(
                    f"submission {one.name!r}: its {what} must be those of the board, {b}, got {a}"
                )
        if one.name in taken:
            raise InvalidValueError(f"submission {one.name!r}: the board has a SLAM of that name")
        taken.add(one.name)


def _on_the_same_scans(
    one: Submission, track: str, digests: dict[tuple[float, int], str]
) -> list[dict[str, Any]]:
    rows = one.rows(track)
    for row in rows:
        if row["recording"] != digests[row["dynamism"], row["seed"]]:
            raise InvalidValueError(
                f"submission {one.name!r}: {track}, level {row['dynamism']:g}, seed {row['seed']} "
                "is of other scans than here: made by another version of mobilia, MuJoCo or NumPy, "
                "or on another kind of processor"
            )
    return rows


# A control; and one that runs on corners of the paper's kind, not on scans.
_NOT_BY_THEMSELVES = ("odometry", "shunting-features")


def installed() -> tuple[tuple[str, ...], dict[str, str]]:
    """The names of those that can run here; of each of the others, why it cannot."""
    there: list[str] = []
    missing: dict[str, str] = {}
    for name in system.names():
        if name in _NOT_BY_THEMSELVES:
            continue
        try:
            system.create(name)
            there.append(name)
        except MissingDependencyError as error:
            missing[name] = str(error).partition("\n")[0]
    return tuple(there), missing

# SPDX-License-Identifier: Apache-2.0
"""The benchmark as a whole: a comparison for each track, and the leaderboard of all of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.benchmark import days, published, runs_file, submission
from scripts.benchmark.board import Board
from scripts.benchmark.runs_file import Digests, Made, Results, checked_name
from scripts.benchmark.tracks import LEVELS, QUICK_LEVELS, TEST, TRACKS, TRAIN, Track
from scripts.comparison.folder import Compared
from scripts.comparison.make import carry_out as compare
from scripts.comparison.plan import Plan
from scripts.console import note
from scripts.days.buildings import DAYS, Buildings
from scripts.days.buildings import carry_out as live
from scripts.machine import machine, versions
from scripts.output import result_folder
from sim.core.versions import WORLD
from slam import system
from slam.errors import InvalidValueError, MissingDependencyError

COMMAND = "benchmark"
SEEDS, QUICK_SEEDS = 6, 1
Runs = dict[str, list[dict[str, Any]]]  # rows of runs.csv by track


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is to be run.

    slams    beside the controls of each track; the subject is one of them
    train    on the seeds that are for tuning, not on those that count
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
    seeds: int = SEEDS
    quick: bool = False
    seconds: float | None = None
    submit: str | None = None
    missing: Mapping[str, str] = field(default_factory=dict)
    days: bool = False

    def __post_init__(self) -> None:
        if self.submit is not None:
            checked_name(self.submit, self.subject)
        if self.subject not in self.slams:
            raise InvalidValueError(f"the subject {self.subject!r:.80} is none of the SLAMs")
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
        return not self.train and self.seconds is None

    def buildings(self) -> Buildings:
        """Of the section over days."""
        known = TRAIN if self.train else TEST
        return days.buildings(
            self.slams, known[: self.seeds], quick=self.quick, seconds=self.seconds
        )

    def head(self) -> dict[str, Any]:
        """What a leaderboard says of how it was made."""
        each = (k for track in self.tracks for k in self.seeds_of(track)[: self.seeds])
        seeds = list(dict.fromkeys(each))
        return {
            "tracks_run": [track.name for track in self.tracks],
            "seeds_of": "train" if self.train else "test",
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
    merge: Sequence[Results] = (),
    shared: Results | None = None,
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
        own = None if wanted.submit is None else _submitted(wanted, runs, digests, out)
        for one in merge:
            _check_scans(one, digests)
        if shared is not None:
            _tell_of_others(shared, digests)
        for name in plans:
            for one in (*merge, *filter(None, [shared])):
                there = {row["slam"] for row in runs[name]}
                runs[name] = runs[name] + one.rows(name, digests[name], there)
        with written() as staged:
            made = _board(wanted, runs, merge, aged)
            made.write(staged)
            if lives is not None:
                days.write(staged, days.head(lives), aged)
            if own is not None:
                runs_file.write(staged / submission.file_of(own.name), own)
    return made


def plans_of(wanted: Wanted, shared: Results | None) -> dict[str, Plan]:
    """The comparison of each track by name, without the oracles whose runs ``shared`` has."""
    shared = shared if wanted.public else None
    return {
        track.name: wanted.plan(track, shared is None or not _has_oracles(shared, wanted, track))
        for track in wanted.tracks
    }


def _has_oracles(shared: Results, wanted: Wanted, track: Track) -> bool:
    asked = [(run.dynamism, run.seed) for run in wanted.plan(track).runs()]
    return all(shared.has(track.name, asked, oracle) for oracle in track.oracles)


def _tell_of_others(shared: Results, digests: Mapping[str, Digests]) -> None:
    """A note where the recordings here are others than the published ones."""
    here = sum(map(len, digests.values()))
    if others := sum(len(shared.others(name, own)) for name, own in digests.items()):
        note(
            f"{others} of {here} recordings are others here than those of the published runs (made "
            "by another version of MuJoCo or NumPy, or on another kind of processor): the SLAMs "
            "published have no rows there. --slam YOURS A B C runs them here"
        )


def _board(
    wanted: Wanted, runs: Runs, merge: Sequence[Results], aged: Sequence[Mapping[str, Any]]
) -> Board:
    head = {**wanted.head(), "versions": versions(), "machine": machine()}
    return Board(
        subject=wanted.subject, head=head, tracks=wanted.tracks, runs=runs, missing=wanted.missing,
        merged={one.name: one.origin() for one in merge},
        days=days.summary(aged), days_page=days.section(aged) if aged else "",
    )  # fmt: skip


def _submitted(wanted: Wanted, runs: Runs, digests: Mapping[str, Digests], out: Path) -> Results:
    """The subject's runs, for others."""
    name, slam = str(wanted.submit), wanted.subject
    kept: dict[str, Made] = {}
    for track, rows in runs.items():
        compared, own = Compared(out / track), kept.setdefault(track, {})
        for row in (row for row in rows if row["slam"] == slam):
            at = (row["dynamism"], row["seed"])
            said = compared.run(row["scene"], *at).believed(slam)
            poses = submission.digest_of(said.stamps_ns, said.poses)
            own[at] = (digests[track][at], {name: submission.run_of(row, poses)})
    made_with = submission.made_with(slam)
    return Results(name=name, slam=slam, seconds=wanted.seconds, runs=kept, made_with=made_with)


def _check_alike(merge: Sequence[Results], wanted: Wanted, taken: set[str]) -> None:
    """``InvalidValueError`` for one that did not run what is to be run here, or is called alike."""
    of = {
        track.name: tuple(sorted(wanted.seeds_of(track)[: wanted.seeds])) for track in wanted.tracks
    }
    for one in merge:
        shared = [track for track in one.runs if track in of]
        if not shared:
            raise InvalidValueError(
                f"submission {one.name!r}: the board has none of its tracks: {', '.join(one.runs)}"
            )
        pairs: list[tuple[str, Any, Any]] = [("seconds", one.seconds, wanted.seconds)]
        for track in shared:
            levels, seeds = ({at[k] for at in one.runs[track]} for k in (0, 1))
            pairs += [("levels", tuple(sorted(levels)), wanted.levels)]
            pairs += [(f"seeds of {track}", tuple(sorted(seeds)), of[track])]
        for what, a, b in pairs:
            if a != b:
                raise InvalidValueError(
                    f"submission {one.name!r}: its {what} must be those of the board, {b}, got {a}"
                )
        if one.name in taken:
            raise InvalidValueError(f"submission {one.name!r}: the board has a SLAM of that name")
        taken.add(one.name)


def _check_scans(one: Results, digests: Mapping[str, Digests]) -> None:
    """``InvalidValueError`` for a submission that ran on other scans than those here."""
    for track, own in digests.items():
        for level, seed in one.others(track, own):
            raise InvalidValueError(
                f"submission {one.name!r}: {track}, level {level:g}, seed {seed} "
                "is of other scans than here: made by another version of mobilia, MuJoCo or NumPy, "
                "or on another kind of processor"
            )


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

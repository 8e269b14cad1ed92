# SPDX-License-Identifier: Apache-2.0
"""The answer in a sentence: from which level on a SLAM is lost, and whether that is its own fault.

``standing`` reads the rows of ``runs.csv``, ``answer`` says what they show, ``controls`` how far
the room can be trusted, ``failed`` who raised, hung or gave no answer. All of them are pure.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from scripts.comparison.rules import LEVEL
from scripts.comparison.schema import FAILED
from scripts.comparison.tables import by_seed, grouped, number
from scripts.options import PEOPLE
from scripts.report.study import LEAST_RUNS, verdict
from slam.evaluation.statistics import paired, share_interval
from slam.variants import ORACLE, oracle_of

Row = dict[str, Any]
MOST_SEEDS = 50  # that anybody would run
TRACK_SEEDS = 20  # that a track has
ODOMETRY = "odometry"  # the control that looks at nothing
_ATE = "ate_unaligned_m"
_WORDS = {
    "raised": "raised or ended", "hung": "hung", "nan": "gave a pose that is not finite",
    "bad": "gave no answer to the frame",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Lost:
    """Of so many runs the lost ones, and those among them in which the SLAM failed."""

    lost: int
    runs: int
    failed: int = 0

    @property
    def half(self) -> bool:
        """Whether half of the runs or more are lost."""
        return 2 * self.lost >= self.runs > 0

    def __str__(self) -> str:
        interval = percent(self.lost, self.runs)
        return f"{self.lost} of {self.runs} runs" + (f", {interval}" if interval else "")


def listed(words: Sequence[str]) -> str:
    """a, b and c."""
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def percent(hits: int, runs: int) -> str:
    """The 95 % interval of a share in words; "" where the runs are too few for one."""
    if runs < LEAST_RUNS:
        return ""
    low, high = share_interval(hits, runs)
    return f"{100.0 * low:.0f} to {100.0 * high:.0f} %"


@dataclass(frozen=True, kw_only=True)
class Level:
    """One level of a room. A control is None where it did not run, or is the subject itself.

    against  the subject against odometry, by the position error run by run: 1 nearer, -1 worse,
             0 unclear
    farther  in so many of their runs it was farther off than odometry
    """

    at: float
    subject: Lost
    odometry: Lost | None = None
    against: int = 0
    farther: int = 0
    oracle: Lost | None = None


@dataclass(frozen=True, kw_only=True)
class Standing:
    """What the runs of a room tell of one SLAM. ``levels`` ascend.

    own_oracle  the oracle is that SLAM's own: if it fails too, the room may be fair all the same
    runs_a_seed  at each level: rooms, such as the tracks of a benchmark
    """

    subject: str
    scene: str
    axis: str
    levels: tuple[Level, ...]
    own_oracle: bool = False
    runs_a_seed: int = 1

    @property
    def bracket(self) -> tuple[Level | None, Level | None]:
        """The last level that holds before the first that is lost, and that one."""
        first = next((level for level in self.levels if level.subject.half), None)
        before = [level for level in self.levels if first is None or level.at < first.at]
        return (before[-1] if before else None), first

    def at(self, *levels: float) -> str:
        """Such as " at 0.5 and 1"; "" where there is one level alone."""
        return "" if len(self.levels) == 1 else " at " + listed([f"{at:g}" for at in levels])

    def place(self, levels: Sequence[float]) -> str:
        """Such as "dynamism 0.5 and 1", or "8 and 12 people"."""
        each = listed([f"{level:g}" for level in levels])
        return f"{each} {PEOPLE}" if self.axis == PEOPLE else f"{self.axis} {each}"


def _each(counts: Sequence[Lost]) -> str:
    """Of levels at which nothing was lost. Not their sum: a seed draws the same room at each."""
    least = min(counts, key=lambda one: one.runs)
    if len(counts) == 1:
        return str(least)
    interval = percent(0, least.runs)
    return f"0 of {least.runs} runs at each level" + (f", {interval}" if interval else "")


def standing(
    rows: Sequence[Row], subject: str, scene: str, axis: str = "dynamism", runs_a_seed: int = 1
) -> Standing:
    """Of the rows of ``runs.csv``. The oracle is the one that is lost least."""
    rows = [row for row in rows if row["scene"] == scene]
    slams = list(dict.fromkeys(str(row["slam"]) for row in rows))
    rivals = [] if is_control(subject) else slams
    oracles = [slam for slam in rivals if slam.startswith(ORACLE)]
    oracle = min(oracles, key=lambda slam: _lost(rows, slam).lost, default=None)
    odometry = ODOMETRY if ODOMETRY in rivals else None
    levels = []
    for (at,), here in sorted(grouped(rows, ("dynamism",)).items()):
        level = Level(at=float(at), subject=_lost(here, subject))
        if odometry:
            farther = sum(a > b for a, b in _errors(here, subject, odometry))
            level = replace(
                level, odometry=_lost(here, odometry), against=against(here, subject, odometry),
                farther=farther,
            )  # fmt: skip
        levels.append(replace(level, oracle=_lost(here, oracle)) if oracle else level)
    own = oracle is not None and (oracle_of(oracle) or ("",))[0] == subject
    return Standing(
        subject=subject, scene=scene, axis=axis, levels=tuple(levels), own_oracle=own,
        runs_a_seed=runs_a_seed,
    )  # fmt: skip


def is_control(slam: str) -> bool:
    """Whether others are held against it: odometry and oracles."""
    return slam == ODOMETRY or slam.startswith(ORACLE)


def _lost(rows: Sequence[Row], slam: str) -> Lost:
    own = [row for row in rows if row["slam"] == slam]
    return Lost(
        lost=sum(bool(number(row, "lost")) for row in own),
        runs=len(own),
        failed=sum(row["outcome"] in FAILED for row in own),
    )


def against(rows: Sequence[Row], a: str, b: str) -> int:
    """SLAM ``a`` against ``b`` by the position error, seed by seed: 1 nearer, -1 worse, 0 unclear.

    rows  of one scene at one level
    """
    both = _errors(rows, a, b)
    if not both:
        return 0
    of_a, of_b = zip(*both, strict=True)
    return verdict(paired(of_a, of_b, less_is_better=True), less_is_better=True)


def _errors(rows: Sequence[Row], a: str, b: str) -> list[tuple[float, float]]:
    """Of both, on each run that both have."""
    of_a, of_b = by_seed(rows, a, _ATE), by_seed(rows, b, _ATE)
    return [(of_a[seed], of_b[seed]) for seed in sorted(of_a.keys() & of_b.keys())]


def answer(of: Standing) -> str:
    """What was seen, what may be concluded from so many runs, and what would decide more."""
    said = [f"`{of.subject}` {_seen(of)}", _concluded(of), _first_level(of), _too_easy(of),
            _unfair(of), _to_decide(of)]  # fmt: skip
    return "; ".join(part for part in said if part) + "."


def _seen(of: Standing) -> str:
    """In how many runs it was lost, level by level, and between which levels that begins."""
    counts = [level.subject for level in of.levels]
    lost, runs = sum(one.lost for one in counts), sum(one.runs for one in counts)
    failed_ = sum(one.failed for one in counts)
    verb = "failed" if 0 < failed_ == lost else "failed or was lost" if failed_ else "was lost"
    top = of.place([of.levels[-1].at])
    if not lost:
        span = f"up to {top}" if len(counts) > 1 else f"at {top}"
        return f"was lost in none of {runs} runs in {of.scene}, {span}"
    if lost == runs:
        already = f", already at {of.place([of.levels[0].at])}" if len(counts) > 1 else f" at {top}"
        return f"{verb} in {lost} of {runs} runs in {of.scene}{already}"
    if len(counts) == 1:
        return f"{verb} in {counts[0].lost} of {runs} runs in {of.scene} at {top}"
    places = [of.place([of.levels[0].at]), *(f"{level.at:g}" for level in of.levels[1:])]
    each = [f"{one.lost} of {one.runs} at {at}" for one, at in zip(counts, places, strict=True)]
    return f"{verb} in {of.scene} in {listed(each)}"


def _concluded(of: Standing) -> str:
    """The bracket of levels, and what share of such runs at its ends is lost, 95 %."""
    before, first = of.bracket
    end = first or max(reversed(of.levels), key=lambda level: level.subject.lost)
    low, high = share_interval(end.subject.lost, end.subject.runs)
    if first is None:
        return f"so at most {100.0 * high:.0f} % of such runs are lost{of.at(end.at)} (95 %)"
    sure = f"so at least {100.0 * low:.0f} % of such runs are lost{of.at(end.at)} (95 %)"
    if before and all(level.subject.half for level in of.levels if level.at >= first.at):
        begins = f"at {first.at:g}"
        if of.axis == PEOPLE:
            begins = f"from {of.place([first.at])} on in {of.scene}"
        if before.subject.lost:
            return f"half of the runs or more are lost {begins}, {sure}"
        return f"it holds at {before.at:g} and is lost {begins}, {sure}"
    return sure


def _to_decide(of: Standing) -> str:
    """How many seeds would tell on which side of one half it is, at the ends of the bracket."""
    open_ = [level for level in of.bracket if level is not None and _is_open(level.subject)]
    if not open_:
        return ""
    most = TRACK_SEEDS if of.axis == LEVEL else MOST_SEEDS
    wanted = [_runs_to_tell(level.subject, most * of.runs_a_seed) for level in open_]
    at = of.at(*(level.at for level in open_))
    if not all(wanted):
        return f"that is too near to one half{at} for {most} seeds to tell"
    seeds = math.ceil(max(wanted) / of.runs_a_seed)
    return f"`--seeds {seeds}` would tell whether more than half are lost{at}"


def _is_open(seen: Lost) -> bool:
    low, high = share_interval(seen.lost, seen.runs)
    return low <= 0.5 <= high


def _runs_to_tell(seen: Lost, most: int) -> int:
    """Least runs of that share lost whose interval is on one side of one half; where there are none
    up to ``most``, 0, or of very few runs ``LEAST_RUNS``: the share itself may be another.
    """
    for runs in range(seen.runs + 1, most + 1):
        if not _is_open(Lost(lost=round(seen.lost / max(seen.runs, 1) * runs), runs=runs)):
            return runs
    return LEAST_RUNS if seen.runs < LEAST_RUNS else 0


def _first_level(of: Standing) -> str:
    """What the lowest level tells: a SLAM that is bad there has another problem than the axis."""
    low = of.levels[0]
    what = {LEVEL: "what moves is", PEOPLE: "people are"}.get(of.axis, f"{of.axis} is")
    so = f", so {what} not its problem" if low.at == 0.0 else ""
    if low.against == -1:
        return f"at {low.at:g} it is already worse than its own odometry{so}"
    if low.subject.half and so:
        return f"this begins at 0{so}"
    if 2 * low.farther > low.subject.runs:
        runs = f"{low.farther} of {low.subject.runs} runs"
        return f"at {low.at:g} it was farther off than its own odometry in {runs}"
    return ""


def _too_easy(of: Standing) -> str:
    """Whether a SLAM that is never lost has been tried at all."""
    alone = [level.odometry for level in of.levels if level.odometry is not None]
    lost = any(level.subject.lost for level in of.levels) or any(one.lost for one in alone)
    if lost or not alone:
        return ""
    return "but odometry alone is not lost either, so these runs are too easy to tell"


def _unfair(of: Standing) -> str:
    """Where the oracle is lost too, and how often at the worst."""
    at = [level for level in of.levels if level.oracle is not None and level.oracle.lost]
    if not at:
        return ""
    worst = max(at, key=lambda level: level.oracle.lost if level.oracle else 0)
    where = "there" if len(of.levels) == 1 else f"at {of.place([level.at for level in at])}"
    most = "" if len(at) == 1 else f" at {worst.at:g}"
    if of.own_oracle:
        return (
            f"without the returns of movers it is lost too {where} ({worst.oracle}{most}), so they "
            "are not its only problem, or the room is unfair"
        )
    return f"the oracle fails too {where} ({worst.oracle}{most}): the room is unfair there"


def controls(of: Standing) -> list[str]:
    """What odometry and the oracle did on the same runs, or how to ask them."""
    if is_control(of.subject):
        return []
    top = of.levels[-1]
    best = [level.oracle for level in of.levels if level.oracle is not None]
    alone = "Odometry, the control that looks at nothing, did not run: `--slam … odometry`."
    if top.odometry:
        alone = f"Odometry alone is lost in {top.odometry}, at {of.place([top.at])}."
    fair = "No oracle ran: `--oracle shunting` tells whether the room is fair."
    if any(one.lost for one in best):
        most = max(best, key=lambda one: one.lost / max(one.runs, 1))
        fair = f"The oracle is lost in up to {most}."
    elif best:
        fair = f"The oracle is never lost ({_each(best)}), so the room is fair."
    return [alone, fair]


def failed(rows: Sequence[Row], axis: str = "dynamism") -> list[str]:
    """A line for each SLAM that failed and way of failing: how often, where first, what it said."""
    said = []
    bad = [row for row in rows if row["outcome"] in FAILED]
    for (slam, outcome), own in grouped(bad, ("slam", "outcome")).items():
        runs = sum(row["slam"] == slam for row in rows)
        first = own[0]
        where = f"{first['scene']} at {axis} {first['dynamism']:g}, seed {first['seed']:g}"
        line = f"`{slam}` {_WORDS[outcome]} in {len(own)} of {runs} runs, first in {where}"
        said.append(f"{line}: {first['failure'] or 'no word of why'}")
    return said

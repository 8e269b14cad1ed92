# SPDX-License-Identifier: Apache-2.0
"""Who did it: re-runs from the checkpoint with one thing changed each, and the verdict.

A change **cures** a divergence when by the end of the horizon (median over its last second) less
error than ``CURED`` of the original's has been gathered since the checkpoint.
"""

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from scenes.groups import CROWDS, groups_of, named, with_held
from scripts.debugger.question import Question
from scripts.debugger.recording import Checkpoint, Pair, Sighting, Strip, Tape, row_at, sightings
from sim.twins.absence import Change
from slam.errors import SlamFailedError
from slam.evaluation.lost import Divergence, first_divergence, largest_rise_m
from slam.frames import Float

CURED = 0.5
LAST_S = 1.0
REPEATED = 3  # of the cures by several at once
PAIRED = 4  # the likeliest of which pairs are tried

Note = Callable[[str, int, int], None]


@dataclass(kw_only=True, eq=False)
class Trial:
    """One re-run.

    kind      "single" (with what it holds), "pair", "group" or "all"
    rise_m    error gathered from the checkpoint to the horizon; NaN: the SLAM failed
    share     of the original's rise that is gone
    path_m    most that the robot's path differs from the original
    others_m  most that another mover's place differs at the end
    again     in how many of the repeats with other noise it cures as well
    """

    change: Change
    kind: str
    rise_m: float = math.nan
    share: float = math.nan
    cured: bool = False
    path_m: float = math.nan
    others_m: float = math.nan
    strip: Strip = field(default_factory=Strip, repr=False)
    failed: str = ""
    again: int = 0


@dataclass(eq=False)
class Inquest:
    """What was found. ``moment`` None: the run has no divergence, ``largest_rise_m`` says how near
    it came.

    first, begins, found, last  rows of the tape: checkpoint, beginning of the divergence, where it
    is found, horizon
    rise_m   of the original since the checkpoint
    recurs   in how many repeats with other noise the original diverges too
    """

    tape: Tape
    question: Question
    largest_rise_m: float
    end_error_m: float
    moment: Divergence | None = None
    first: int = 0
    last: int = 0
    rise_m: float = 0.0
    how: str = ""
    recurs: int = 0
    suspects: list[Sighting] = field(default_factory=list)
    trials: list[Trial] = field(default_factory=list)

    @property
    def then(self) -> Pair:
        """The true and the believed pose at the checkpoint, since which errors are gathered."""
        return self.tape.then(self.first)

    @property
    def cures(self) -> list[Trial]:
        """Single changes that cure, the best first; of one mover the better of its two."""
        best: dict[str, Trial] = {}
        singles = [t for t in self.trials if t.kind == "single" and t.cured]
        for trial in sorted(singles, key=lambda t: (-t.again, -t.share)):
            best.setdefault((*trial.change.out, *trial.change.frozen)[0], trial)
        return list(best.values())

    @property
    def together(self) -> list[Trial]:
        """Changes of several that cure, pairs first."""
        cured = [t for t in self.trials if t.kind != "single" and t.cured]
        return sorted(cured, key=lambda t: (t.kind == "all", -t.again, -t.share))

    @property
    def named(self) -> list[Trial]:
        """The cures that the verdict rests on: they cure with most other draws of the noise too."""
        most = self._most
        if self.cures:
            return [t for t in self.cures if t.again >= most]
        return [t for t in self.together if t.again >= most][:1]

    @property
    def _most(self) -> int:
        """More than half of the repeats."""
        return self.question.repeats // 2 + 1 if self.question.repeats else 0

    @property
    def verdict(self) -> str:
        """One of ``VERDICTS``."""
        if self.moment is None:
            return "none"
        if self.rise_m < CURED * self.question.rule.threshold_m:
            return "weak"
        if self.rare:
            return "undecided"
        if self.named and self.cures:
            return "culprit" if len(self.named) == 1 else "several"
        if self.named:
            return "joint"
        return "undecided" if self.cures or self.together else "not the movers"

    @property
    def rare(self) -> bool:
        """With most other draws of the noise the original does not diverge: it hung on a hair."""
        return self.recurs < self._most

    @property
    def firm(self) -> bool:
        """It happens again with other noise, and the cure works again, each time."""
        again = min((t.again for t in self.named), default=self.question.repeats)
        return self.recurs == again == self.question.repeats


def hold(tape: Tape, question: Question, note: Note = lambda what, done, of: None) -> Inquest:
    """Find the divergence of a tape and who is to blame for it."""
    strip, rule = tape.strip, question.rule
    run = (strip.stamps_ns(), strip.truth, strip.believed)
    found = Inquest(
        tape=tape,
        question=question,
        largest_rise_m=largest_rise_m(*run, rule),
        end_error_m=float(strip.errors_m(tape.then(0))[-1]),
    )
    if question.at_s is None:
        found.moment = first_divergence(*run, rule)
    else:
        row = row_at(tape, question.at_s)
        found.moment = Divergence(begins=row, found=row, rise_m=0.0)
    if found.moment is None:
        return found
    _rows(found, found.moment)
    checkpoint = Checkpoint(tape, found.first)
    checkpoint.verify(found.last)
    found.how = checkpoint.how
    found.rise_m = _rise_m(found, strip.cut(found.first, found.last))
    if found.verdict != "weak":
        _try_all(found, checkpoint, note)
    return found


def _rows(found: Inquest, moment: Divergence) -> None:
    tape, question = found.tape, found.question
    stamps = tape.strip.stamps_ns()
    before = int(np.searchsorted(stamps, stamps[moment.begins] - round(question.lead_s * 1e9)))
    after = stamps[moment.found] + round(question.horizon_s * 1e9)
    found.first = tape.row_before(before)
    found.last = int(np.searchsorted(stamps, after, side="right")) - 1
    found.suspects = sightings(tape, found.first, moment.found)
    if question.top:
        found.suspects = found.suspects[: question.top]


def _try_all(found: Inquest, checkpoint: Checkpoint, note: Note) -> None:
    """Controls, each suspect in both ways, and pairs where nobody alone is to blame."""
    plan = _plan(found)
    for done, (kind, change) in enumerate(plan):
        note(str(change), done, len(plan))
        found.trials.append(_trial(found, checkpoint, kind, change))
    plain = not found.question.who
    if plain and not found.cures and any(t.cured for t in found.trials):
        for change in _pairs(found):
            note(str(change), len(plan), len(plan))
            found.trials.append(_trial(found, checkpoint, "pair", change))
    limit_m = CURED * found.rise_m
    found.recurs = sum(rise >= limit_m for rise in _again_m(found, checkpoint, Change(), note))
    singles = [t for t in found.trials if t.kind == "single" and t.cured]
    for trial in sorted(singles, key=lambda t: -t.share) or found.together[:REPEATED]:
        rises = _again_m(found, checkpoint, trial.change, note)
        trial.again = sum(rise < limit_m for rise in rises)


def _plan(found: Inquest) -> list[tuple[str, Change]]:
    everybody = tuple(
        name for name, kind in zip(found.tape.names, found.tape.kinds, strict=True)
        if kind != "robot"
    )  # fmt: skip
    if not everybody:
        return []
    controls = [("all", Change(out=everybody)), ("all", Change(frozen=everybody))]
    asked = found.question.who
    if asked:
        return controls + [trial for word in asked for trial in _asked(found.tape, word)]
    plan = controls + [trial for group in _crowds(found) for trial in _asked(found.tape, group)]
    return plan + [trial for s in found.suspects for trial in _asked(found.tape, s.name)]


def _asked(tape: Tape, word: str) -> list[tuple[str, Change]]:
    """A mover, a group or a pattern out, with what they hold, and frozen."""
    names = named(tape.movers, word) if tape.movers else (word,)
    called, kind = ("", "single") if names == (word,) else (word, "group")
    out = Change(out=with_held(tape.holds, names), called=called)
    return [(kind, out), (kind, Change(frozen=names, called=called))]


def _crowds(found: Inquest) -> list[str]:
    """Groups of a crowd of which two or more were seen."""
    seen = {suspect.name for suspect in found.suspects}
    groups = groups_of(found.tape.movers)
    return [word for word in CROWDS if len(seen & set(groups.get(word, ()))) > 1]


def _pairs(found: Inquest) -> list[Change]:
    likeliest = [suspect.name for suspect in found.suspects[:PAIRED]]
    changes = []
    for pair in itertools.combinations(likeliest, 2):
        changes += [Change(out=with_held(found.tape.holds, pair)), Change(frozen=pair)]
    return changes


def _trial(found: Inquest, checkpoint: Checkpoint, kind: str, change: Change) -> Trial:
    try:
        strip = checkpoint.rerun(change, found.last)
    except SlamFailedError as error:
        return Trial(change=change, kind=kind, failed=str(error))
    rise, tape = _rise_m(found, strip), found.tape
    path = np.array(strip.truth) - np.array(tape.strip.truth[found.first : found.last + 1])
    changed = (*change.out, *change.frozen)
    others = [m for m, name in enumerate(tape.names) if name not in changed]
    gap: Float = strip.poses[-1][others] - tape.strip.poses[found.last][others]
    return Trial(
        change=change, kind=kind, rise_m=rise, share=1.0 - rise / found.rise_m,
        cured=rise < CURED * found.rise_m, path_m=_longest(path), others_m=_longest(gap),
        strip=strip,
    )  # fmt: skip


def _again_m(found: Inquest, checkpoint: Checkpoint, change: Change, note: Note) -> Iterator[float]:
    """The rise with each other noise; NaN where the SLAM fails then: neither again nor cured."""
    for noise in range(1, found.question.repeats + 1):
        what = f"{change}, " if change != Change() else ""
        note(f"{what}other noise {noise}", 1, 1)
        try:
            yield _rise_m(found, checkpoint.rerun(change, found.last, noise=noise))
        except SlamFailedError:
            yield math.nan


def _rise_m(found: Inquest, strip: Strip) -> float:
    """m that a strip has gathered since the checkpoint by its end."""
    errors, stamps = strip.errors_m(found.then), strip.stamps_ns()
    late = stamps >= stamps[-1] - round(LAST_S * 1e9)
    return float(np.median(errors[late]))


def _longest(ways: Float) -> float:
    """m, 0 of none."""
    return float(np.sqrt(ways[:, 0] * ways[:, 0] + ways[:, 1] * ways[:, 1]).max(initial=0.0))

# SPDX-License-Identifier: Apache-2.0
"""The smallest part of a lost run in which its SLAM is lost again, found by delta debugging.

A part begins at some scan: the SLAM starts there, at the true pose, without a map. It is tried by
running it. Seconds come first, then movers and events, at last scans and beams.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise, product
from typing import Any, TypeVar

import numpy as np

from scripts.debugger.recording import Case, record, sightings, simulate
from scripts.metrics.judged import Judged, world_truth
from sim.twins.cut import Thin, begin
from slam.errors import InvalidValueError, MobiliaError, UnknownNameError
from slam.evaluation.lost import LOST_RULE, LOST_S
from slam.frames import NS_PER_S, Frame
from slam.frontend.odometry_steps import MotionSum
from slam.interface import RunsAtTheEnd
from slam.replay import Track
from slam.system import create

SHORT_S = 10.0  # s that any part may take to be lost
BEGIN_S = 2.0  # s from one beginning that is tried to the next
BEGINS = 12, 100_000  # so many, by the loss; where no small part is found, those of the whole run
# s of parts that are looked for, one scan in so many of what the SLAM got, and one beam in so many;
# the next where few movers do not lose it.
LADDER = (
    (10.0, 1, 1), (10.0, 2, 1), (10.0, 1, 4), (10.0, 4, 1), (10.0, 2, 4), (10.0, 1, 16),
    (10.0, 8, 1), (10.0, 4, 4), (10.0, 2, 16), (20.0, 1, 1),
)  # fmt: skip
SHORTEST = 4  # parts of which the movers are taken out
FEW = 3  # movers that are tried alone before others are taken out by halves
THINNED = 2  # parts of which first the scans and beams are, where no few movers will do
LONGEST_STEP = 16  # states of the tape, half a second each
LEAST_BEAMS, BATCH = 16, 10  # beams; scans from one look at the loss to the next
MOST_S = 2400.0  # s that are simulated again in all; then the smallest so far is it
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Part:
    """Scans ``first`` to before ``last`` of a tour; the rest as in ``sim.twins.cut.Cut``."""

    first: int
    last: int
    keep: tuple[str, ...] | None = None
    every: int = 1
    beams: int = 1

    @property
    def scans(self) -> int:
        """Of the tour, told or not."""
        return self.last - self.first


class Shrinking:
    """Tries parts of one run.

    case, tape  the run, as far as events were left out;   tape  every scan of it
    tried       the end of each part that was tried;   spent_s  that was simulated again
    """

    def __init__(self, case: Case, note: Callable[[str], None] = lambda words: None) -> None:
        self.note, self.spent_s = note, 0.0
        self.tried: dict[Any, int | None] = {}
        self._use(case)

    def _use(self, case: Case) -> None:
        self.case, self.tape = case, record(replace(case, every=1), heard=False)
        first, second = self.tape.strip.frames[:2]
        self.period_s = (second.stamp_ns - first.stamp_ns) / NS_PER_S
        self.whole = Part(first=0, last=len(self.tape.commands), every=case.every)

    def frames(self, part: Part) -> Iterator[Frame]:
        """What the SLAM gets of a part, with truth and labels."""
        motion, thin = MotionSum(), Thin(part.beams)
        for k, frame in enumerate(self._every_one(part)):
            motion.add(frame.odometry)
            if k % part.every == 0:
                yield thin(motion.passed_on(frame))

    def _every_one(self, part: Part) -> Iterator[Frame]:
        tape = self.tape
        if part.keep is None:
            yield from tape.strip.frames[part.first : part.last]
            return
        simulation = simulate(tape.case)
        begin(simulation, tape.states[part.first][1], part.keep)
        for scan in range(part.first, part.last):
            simulation.world.set_command(*tape.commands[scan])
            yield simulation.observe()

    def lost(self, part: Part) -> Part | None:
        """The part up to where its loss stands; None where the SLAM is not lost, or fails.

        A part that was short before has the time of a short one.
        """
        last = max(part.last, part.first + round(SHORT_S / self.period_s))
        part = replace(part, last=min(last, self.whole.last))
        key = part, repr(self.case.settings)
        if key not in self.tried and self.spent_s > MOST_S:
            return None
        if key not in self.tried:
            movers = "all" if part.keep is None else len(part.keep)
            self.note(f"try {len(self.tried) + 1}: at {part.first * self.period_s:.1f} s, {movers}")
            row = lost_row(self.case.slam, self.frames(part))
            self.tried[key] = None if row is None else part.first + row * part.every + 1
            if part.keep is not None:
                self.spent_s += ((self.tried[key] or part.last) - part.first) * self.period_s
        end = self.tried[key]
        return None if end is None else replace(part, last=end)

    def smallest(self) -> Part:
        """The smallest part that was found.

        Raises ``InvalidValueError`` for a run that is not lost, ``SlamFailedError`` for a SLAM
        that fails in it.
        """
        end = self.lost(self.whole)
        if end is None:
            raise not_lost(self.case.slam, list(self.frames(self.whole)))
        part = self._without_events(self._later(self._with_few(end)))
        return self._later(self._minimal(self._thin(part)))

    def _with_few(self, whole: Part) -> Part:
        """A short part with as few movers as can be."""
        found: list[Part] = []
        for part, names in self._candidates(whole, found):
            if end := self.lost(replace(part, keep=names)):
                found.append(self._later(self._minimal(end)))
                movers, scans = len(found[-1].keep or ()), found[-1].scans
                if movers <= FEW and scans * self.period_s <= SHORT_S:
                    return found[-1]
        if found:
            return min(found, key=lambda part: len(part.keep or ()))
        return self._thin((self._windows(whole, BEGINS[0], *LADDER[-1]) or [whole])[0])

    def _candidates(
        self, whole: Part, found: Sequence[Part]
    ) -> Iterator[tuple[Part, tuple[str, ...]]]:
        """Parts, and which movers stay in them: few; where ``found`` is empty after those all that
        is seen, then all."""
        for begins in BEGINS:
            first: list[Part] = []
            for rung in LADDER:
                windows = self._windows(whole, begins, *rung)
                first = first or windows
                yield from self._tries(windows)
            part = self._thin((first or [whole])[0])
            if not found:
                yield part, self._likeliest(part, len(self.tape.names))
            if not found:
                kinds = zip(self.tape.names, self.tape.kinds, strict=True)
                yield part, tuple(name for name, kind in kinds if kind != "robot")

    def _windows(
        self, whole: Part, begins: int, seconds: float, every: int, beams: int
    ) -> list[Part]:
        """The shortest parts with everybody, the best first; of the whole run one a loss.

        Where scans and beams are left out they must not be lost with nobody, as in ``_thin``.
        """
        step, short = round(BEGIN_S / self.period_s), round(SHORT_S / self.period_s)
        rows = {row // step: row for row in sorted(self.tape.states, reverse=True)}.values()
        near = sorted(rows, key=lambda row: abs(row - whole.last + short))[:begins]
        like = replace(whole, every=every * whole.every, beams=beams)
        length = round(seconds / self.period_s)
        ends = [self.lost(replace(like, first=row, last=row + length)) for row in near]
        found = sorted(filter(None, ends), key=lambda part: (part.scans, part.first))
        if begins > BEGINS[0]:
            losses = {part.last // step: part for part in reversed(found)}
            found = sorted(losses.values(), key=lambda part: (part.scans, part.first))
        if every > 1 or beams > 1:
            found = [part for part in found if not self.lost(replace(part, keep=()))]
        return found[:SHORTEST]

    def _tries(self, windows: Sequence[Part]) -> Iterator[tuple[Part, tuple[str, ...]]]:
        """Parts, and which movers stay in them; then thin ones."""
        thin = (self._thin(part) for part in windows[:THINNED])
        for parts in (windows, thin):
            pairs = product(range(FEW + 1), list(parts))
            yield from ((part, self._likeliest(part, count)) for count, part in pairs)

    def _likeliest(self, part: Part, count: int) -> tuple[str, ...]:
        """So many of the movers seen in it, and who holds them: else they stand."""
        names = [one.name for one in sightings(self.tape, part.first, part.last - 1)][:count]
        holders = [hold.holder for hold in self.tape.holds if hold.held in names]
        return tuple(dict.fromkeys([*names, *holders]))

    def _minimal(self, part: Part) -> Part:
        """With movers of which none can be left out."""
        if not part.keep:
            return part
        few = minimal(part.keep, lambda names: self.lost(replace(part, keep=tuple(names))))
        return self.lost(replace(part, keep=tuple(few))) or part

    def _later(self, part: Part) -> Part:
        """A later beginning, while that makes it shorter."""
        rows = sorted(self.tape.states)
        at, step = rows.index(part.first), LONGEST_STEP
        while step:
            first = rows[min(at + step, len(rows) - 1)]
            end = self.lost(replace(part, first=first)) if first < part.last else None
            if end is not None and end.scans < part.scans:
                part, at = end, at + step
            else:
                step //= 2
        return part

    def _thin(self, part: Part) -> Part:
        """Fewer scans and beams, as long as it is the movers: without them it must not be lost."""
        scan = self.tape.strip.frames[0].scan
        assert scan is not None
        most = {"every": part.scans // 2, "beams": scan.spec.n_beams // LEAST_BEAMS}
        for name in most if part.keep != () else ():
            while 2 * getattr(part, name) <= most[name]:
                thin = replace(part, **{name: 2 * getattr(part, name)})
                end = self.lost(thin)
                if end is None or self.lost(replace(thin, keep=())):
                    break
                part = end
        return part

    def _without_events(self, part: Part) -> Part:
        """Without those events, and without that carrying, that need not be."""
        case, kinds = self.case, ("events", "kidnap_every_s")
        what = [("events", row) for row in case.settings.get("events") or ()]
        what += [(kind, case.settings[kind]) for kind in kinds[1:] if case.settings.get(kind)]

        def still(kept: Sequence[tuple[str, Any]]) -> Part | None:
            own = {key: value for key, value in case.settings.items() if key not in kinds}
            own |= {"events": [row for kind, row in kept if kind == "events"]}
            own |= {kind: value for kind, value in kept if kind != "events"}
            self._use(replace(case, settings=own))
            try:
                return self.lost(part)
            except UnknownNameError:  # a visitor that nobody lets in
                return None

        return (still(minimal(what, still)) or part) if what else part


def lost_row(slam: str, frames: Iterable[Frame]) -> int | None:
    """The number of the frame at which the loss of a fresh SLAM stands; None where it is not lost,
    or fails. Few frames after that are taken."""
    track, told, rest = Track(slam, create(slam)), list[Frame](), iter(frames)
    size = None if isinstance(track.system, RunsAtTheEnd) else BATCH
    while batch := list(islice(rest, size)):
        if track.survive(batch) is not None:
            return None
        told += batch
        judged = Judged.of(track, world_truth(told))
        if judged.lost_s is not None:
            stamps = judged.known.stamps_ns
            return int(np.argmax((stamps - stamps[0]) / NS_PER_S - judged.lost_s > LOST_S))
    return None


def not_lost(slam: str, frames: Sequence[Frame]) -> MobiliaError:
    """Why the SLAM is not lost in these: it is not, or it fails."""
    track = Track(slam, create(slam))
    if error := track.survive(frames):
        return error
    off = float(Judged.of(track, world_truth(frames)).pairs.distances.max())
    return InvalidValueError(
        f"SLAM '{slam}' is not lost in this run, so there is nothing to shrink: it is {off:.2f} m "
        f"off at most (lost: {LOST_RULE})"
    )


def minimal(items: Sequence[T], holds: Callable[[Sequence[T]], object]) -> list[T]:
    """Some of the items, of which none can be left out; all of them hold.

    Delta debugging (Zeller and Hildebrandt, IEEE Transactions on Software Engineering 28(2), 2002).
    """
    kept, parts = list(items), 2
    if holds([]):
        return []
    while len(kept) > 1:
        ends = [len(kept) * k // parts for k in range(parts + 1)]
        chunks = [kept[a:b] for a, b in pairwise(ends)]
        rests = [kept[:a] + kept[b:] for a, b in pairwise(ends)] if parts > 2 else []
        smaller = next((one for one in (*chunks, *reversed(rests)) if holds(one)), None)
        if smaller is not None:
            kept, parts = smaller, 2 if smaller in chunks else parts - 1
        elif parts == len(kept):
            break
        else:
            parts = min(2 * parts, len(kept))
    return kept

# SPDX-License-Identifier: Apache-2.0
"""What was wrong with a log, its stamps above all, and put right: counted, said, or refused."""

import logging
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from pathlib import Path

from slam.checked import MOST_NS
from slam.errors import LogFormatError
from slam.frames import NS_PER_S, to_s

_log = logging.getLogger(__name__)

TORN_LINE = "torn_last_line"
STAMPS_SORTED = "stamps_stepped_back"
STAMPS_SPREAD = "stamps_equal_spread"
CLOCK_STEPS = "clock_steps_back"
STRAY_STAMPS = "stamps_stray"
STAMPS_WRAPPED = "stamps_wrapped"
SHORT_ODOM = "odom_lines_without_speeds"
NO_ODOMETRY = "scans_with_assumed_odometry"
STANDS_STILL = "odometry_stands_still"
NO_END = "files_without_end"
LOST = "messages_missing"
SHORT_SCANS = "scans_without_beams_or_short"
LEFT_OUT = "scans_left_out"
AT_RANGE_MAX = "returns_at_range_max"
USUAL = (TORN_LINE, STAMPS_SORTED, STAMPS_SPREAD, CLOCK_STEPS, STRAY_STAMPS)
WORDS = {
    TORN_LINE: "{} torn end (a last line or object without its end) left out",
    STAMPS_SORTED: "{} stamps that step back by less than 1 s sorted by time",
    STAMPS_SPREAD: "{} scans with the time of another spread over the time there was",
    CLOCK_STEPS: "{} times the clock steps back by 1 s or more: order of the file kept",
    STRAY_STAMPS: "{} stamps far from their neighbours' replaced",
    STAMPS_WRAPPED: "{} stamps of 4.29497e+09 s (below 0, in 32 bits) put back where they were",
    SHORT_ODOM: "{} ODOM lines without speeds and host read as x y theta t",
    STANDS_STILL: "odometry that stands still while scans move taken as none ({} messages)",
    NO_END: "{} files without an end, of a recorder that was killed, read up to the cut",
    LOST: "{} messages missing that the recording says it has",
    SHORT_SCANS: "{} scans without beams, or of less than half of them, left out",
    LEFT_OUT: "{} scans outside the odometry's time, or with another's time or frame, left out",
    AT_RANGE_MAX: "{} returns in a mass exactly at range_max read as none",
    NO_ODOMETRY: "no odometry: {} scans with that of a constant velocity",
}


@dataclass
class Repairs:
    """Of one log, while it is read.

    strict  whether a repair is refused: ``note`` raises ``LogFormatError`` then
    where   which part of the log is at hand, for what is refused
    counts  how many of each kind were made
    """

    path: Path
    strict: bool = False
    where: str = ""
    counts: Counter[str] = field(default_factory=Counter)

    def note(self, kind: str, why: str, line: int | None = None, count: int = 1) -> None:
        """One repair, or ``count`` of them; ``why`` is what a strict reader says."""
        if self.strict:
            raise LogFormatError(self.path, f"{self.where}{why} (refused by --strict)", line)
        self.counts[kind] += count

    def facts(self) -> dict[str, int]:
        """The counts, of all kinds that most text logs can have, for ``StreamMetadata.extra``."""
        return {kind: self.counts[kind] for kind in WORDS if kind in USUAL or self.counts[kind]}

    def warn(self, why: str = "") -> None:
        """Say all of them in one line, if there are any; and why."""
        said = [
            words.format(self.counts[kind]) for kind, words in WORDS.items() if self.counts[kind]
        ]
        if said:
            because = f" ({why})" if why else ""
            _log.warning("%s repaired: %s%s", self.path, "; ".join(said), because)


MAX_STEP_BACK_NS = NS_PER_S  # what clocks of several processes differ by
MAX_SPREAD_NS = NS_PER_S  # over which equal stamps are spread where nobody says how long they took
STRAYS = 3  # so many stamps in a row may be wrong before they count as another clock
FAR_NS = 10 * NS_PER_S  # ahead of its neighbours, a stamp is a stray one
COARSE_NS = 10 * NS_PER_S  # stamps printed so coarsely do not even say how long a pause was
WRAP_NS = 2**32 * NS_PER_S  # what 32 bits without a sign add to seconds below 0
NEAR_ZERO_NS = 10**7 * NS_PER_S  # the clock of such seconds began within months
FINE_DIGITS = 19  # significant digits of 64-bit nanoseconds


@dataclass(frozen=True)
class Ordered:
    """``order``: indices by time (stable). ``stamps_ns``: those times, strictly increasing."""

    order: list[int]
    stamps_ns: list[int]


def digits_of(word: str) -> int:
    """Significant digits that a number is printed with: 6 of ``1.13486e+09``."""
    return len(word.lower().partition("e")[0].replace(".", "").lstrip("+-0"))


def tick_ns(stamp_ns: int, digits: int) -> int:
    """Between two neighbouring numbers of so many digits around this time."""
    return int(10 ** max(len(str(abs(stamp_ns))) - digits, 0))


def unwrapped(stamps_ns: Sequence[int], lines: Sequence[int], repairs: Repairs) -> list[int]:
    """The stamps, in the order of the log; those that lost their sign in 32 bits have it again.

    Such a log has 4294967295.75 s for -0.25 s. Where the digits do not tell (``4.29497e+09``), the
    clock did not begin at 0, or time goes on beyond them, when they were is unknown: they follow
    those before them and stay before those after them.
    """
    sound = [k for k, stamp in enumerate(stamps_ns) if abs(stamp - WRAP_NS) >= NEAR_ZERO_NS]
    out = list(stamps_ns)
    if len(sound) in (0, len(out)):
        return out
    clock = [out[k] for k in sound]
    far = abs(sorted(clock)[len(clock) // 2]) > NEAR_ZERO_NS
    steps = sorted(b - a for a, b in pairwise(clock) if b >= a)
    usual = steps[len(steps) // 2] if steps else 0
    for a, b in pairwise([-1, *sound, len(out)]):
        if b - a > 1:
            why = f"a time of {to_s(out[a + 1]):.16g} s, as of one below 0 in 32 bits"
            repairs.note(STAMPS_WRAPPED, why, lines[a + 1], b - a - 1)
            out[a + 1 : b] = _signed(out, a, b, usual, known=not far)
    return out


def _signed(stamps_ns: list[int], a: int, b: int, usual: int, *, known: bool) -> list[int]:
    """Times of the stamps between ``a`` and ``b`` (the ends: -1 and their number) with a sign."""
    run = range(a + 1, b)
    inside = a >= 0 and b < len(stamps_ns)
    passed = stamps_ns[b] - stamps_ns[a] if inside else -1
    if known and passed < 0 and all(stamps_ns[k] % COARSE_NS for k in run):
        return [stamps_ns[k] - WRAP_NS for k in run]
    step = usual if passed < 0 else min(usual, passed // (b - a))
    start = stamps_ns[a] - step * a if a >= 0 else stamps_ns[b] - step * b
    return [start + step * k for k in run]


def continued(
    stamps_ns: Sequence[int],
    lines: Sequence[int | None],
    repairs: Repairs,
    digits: int = FINE_DIGITS,
    elapsed_ns: Sequence[int] | None = None,
) -> list[int]:
    """The stamps, in the order of the log, without steps back of 1 s or more.

    A clock that was set back goes on from where it was. Up to three stamps in a row that lie before
    their neighbours, or more than 10 s ahead, are stray ones: they get the stamp before them.

    elapsed_ns  since the stamp before, by another clock; below 0 where that was set back, too

    Raises ``LogFormatError`` where that adds up to more than 64 bits of nanoseconds.
    """
    out: list[int] = []
    offset = latest = 0
    usual = _usual(stamps_ns)
    for k, raw in enumerate(stamps_ns):
        now = raw + offset
        if out and latest - now >= MAX_STEP_BACK_NS + _slack(raw, digits):
            ahead = _strays_before(out, now)
            why = f"time steps back by {to_s(latest - now):g} s"
            if ahead:
                out[-ahead:] = [out[-ahead - 1]] * ahead
                latest = out[-1]
                repairs.note(STRAY_STAMPS, why, lines[k], ahead)
            elif _returns(stamps_ns[k : k + 1 + STRAYS], latest - offset):
                repairs.note(STRAY_STAMPS, why, lines[k])
                now = latest
            else:
                repairs.note(CLOCK_STEPS, why, lines[k])
                step = usual if elapsed_ns is None or elapsed_ns[k] < 0 else elapsed_ns[k]
                offset += latest + step - now
                now = latest + step
        out.append(now)
        latest = max(latest, now) if k else now
    for now, line in zip(out, lines, strict=True):
        if abs(now) > MOST_NS:
            why = f"stamp: expected a time that fits 64 bits of nanoseconds, got {to_s(now):g} s"
            raise LogFormatError(repairs.path, why, line)
    return out


def _returns(stamps_ns: Sequence[int], latest: int) -> bool:
    """Whether a leap ahead takes the first of these back beyond ``latest``."""
    back = latest - stamps_ns[0]
    return any(b >= latest and b - a > back for a, b in pairwise(stamps_ns))


def _slack(stamp_ns: int, digits: int) -> int:
    """Rounding to whole seconds turns a step of a tenth into one of a second."""
    tick = tick_ns(stamp_ns, digits)
    return tick if tick >= NS_PER_S // 10 else 0


def _strays_before(out: list[int], now: int) -> int:
    """How many of the last stamps are far ahead of the one before them, which ``now`` follows."""
    for n in range(1, min(STRAYS, len(out) - 1) + 1):
        before = out[-n - 1]
        if min(out[-n:]) - before > FAR_NS and before <= now <= before + FAR_NS:
            return n
    return 0


def _usual(stamps_ns: Sequence[int]) -> int:
    """The median step ahead; 1 ms where there is none."""
    steps = sorted(b - a for a, b in pairwise(stamps_ns) if b > a)
    return steps[len(steps) // 2] if steps else NS_PER_S // 1000


def put_in_order(
    path: Path,
    stamps_ns: Sequence[int],
    lines: Sequence[int],
    *,
    repairs: Repairs | None = None,
    steps_s: Sequence[float] | None = None,
    digits: int = FINE_DIGITS,
) -> Ordered:
    """Sort stamps that step back a little, separate equal ones.

    Clocks that were read by several processes step back by fractions of a second; 1 s or more are
    repaired as ``continued`` says. Logs printed with few significant digits give neighbours the
    same stamp; m equal stamps are spread over the time to the next later one, because filters
    divide by the time between frames: over at most 1 s, a tick of the printed digits, or what
    ``steps_s`` add up to.

    steps_s  n - 1 rough durations from each to the next, by odometry; None: all alike. Where the
             stamps span several ticks, they are scaled to the time that passed in all
    digits   significant digits that the stamps were printed with
    repairs  counts what was done; by default it is for nobody

    Raises ``LogFormatError`` for repairs that are strict.
    """
    repairs = repairs or Repairs(path)
    stamps_ns = continued(stamps_ns, lines, repairs, digits)
    back = [k for k in range(1, len(stamps_ns)) if stamps_ns[k] < stamps_ns[k - 1]]
    order = sorted(range(len(stamps_ns)), key=stamps_ns.__getitem__)
    strict = _Spread([stamps_ns[k] for k in order], _along(order, steps_s), digits).stamps()
    equal = [k for k in range(1, len(order)) if stamps_ns[order[k]] == stamps_ns[order[k - 1]]]
    if back:
        step_s = to_s(stamps_ns[back[0] - 1] - stamps_ns[back[0]])
        why = f"time steps back by {step_s:g} s"
        repairs.note(STAMPS_SORTED, why, lines[back[0]], len(back))
    if equal:
        at = order[equal[0]]
        why = f"{len(equal)} scans have the time of another, as {to_s(stamps_ns[at]):.9g} s here"
        repairs.note(STAMPS_SPREAD, why, lines[at], len(equal))
    return Ordered(order, strict)


def _along(order: list[int], steps_s: Sequence[float] | None) -> list[float] | None:
    """Durations between neighbours by time; 0 between those that were none in the log."""
    if steps_s is None:
        return None
    return [steps_s[a] if b == a + 1 else 0.0 for a, b in pairwise(order)]


class _Spread:
    """Spreads equal ones among stamps in rising order."""

    def __init__(self, stamps: list[int], steps_s: list[float] | None, digits: int) -> None:
        self._stamps, self._digits = stamps, digits
        self._usual = _usual(stamps)
        n = max(len(stamps) - 1, 0)
        steps = [self._usual] * n if steps_s is None else [round(s * NS_PER_S) for s in steps_s]
        self._known = steps_s is not None
        self._steps = self._scaled(steps) if self._known else steps

    def _scaled(self, steps: list[int]) -> list[int]:
        """To the time that passed in all, where the stamps say."""
        ticks = sorted(set(self._stamps))
        total = sum(steps)
        if total <= 0 or len(ticks) < 4:
            return steps
        return [step * (ticks[-1] - ticks[0]) // total for step in steps]

    def stamps(self) -> list[int]:
        """All of them, strictly increasing."""
        out: list[int] = []
        first, shift = 0, 0
        while first < len(self._stamps):
            last = first
            while last + 1 < len(self._stamps) and self._stamps[last + 1] == self._stamps[first]:
                last += 1
            start = self._stamps[first] + shift
            span, jump = self._span(first, last)
            for offset in self._offsets(first, last, span):
                out.append(max(start + offset, out[-1] + 1 if out else start))
            shift -= jump
            first = last + 1
        return out

    def _span(self, first: int, last: int) -> tuple[int, int]:
        """(time for these equal stamps until the next, by how much all later ones come earlier)."""
        count = last - first + 1
        tick = tick_ns(self._stamps[first], self._digits)
        expected = self._expected(first, last)
        if last + 1 == len(self._stamps):
            return (expected if self._known else self._usual * count), 0
        gap = self._stamps[last + 1] - self._stamps[first]
        if count > 1 and tick >= COARSE_NS and expected < gap <= 2 * tick:
            return expected, gap - expected  # a pause that only the printing made
        return min(gap, max(MAX_SPREAD_NS, tick, expected)), 0

    def _expected(self, first: int, last: int) -> int:
        """How long these took by the steps that were given; 0 where none were."""
        return sum(self._steps_of(first, last)) if self._known else 0

    def _steps_of(self, first: int, last: int) -> list[int]:
        """From each of these to the next; after the last of all, the mean step."""
        steps = self._steps[first : last + 1]
        if last == len(self._steps):
            steps.append(sum(self._steps) // max(len(self._steps), 1))
        return steps

    def _offsets(self, first: int, last: int, span: int) -> Iterable[int]:
        count = last - first + 1
        if not self._known:
            return [k * span // count for k in range(count)]
        steps = [max(step, 1) for step in self._steps_of(first, last)]
        before = accumulate(steps[:-1], initial=0)
        return [at * span // sum(steps) for at in before]

# SPDX-License-Identifier: Apache-2.0
"""Ways in which a robot gets lost, and the cases of a campaign.

In a way without an event a stream is one loss: boards, crowds or rooms that changed do it. In the
others the robot is carried or pushed ``EACH`` times, each time with a copy of the SLAM that has
seen the stream so far. ``docs/integrity.md`` describes each way.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from scripts.integrity.kinds import StreamSpec
from slam.errors import InvalidValueError

EACH = 5  # losses of a case with an event
DECIDABLE = ("flat", "corridor", "hall", "office")  # a place is like no other after half a turn
MAPPED_S = 90.0  # of mapping before a robot is carried
APART = 10_000  # seeds between the first ones of two ways


@dataclass(frozen=True, kw_only=True)
class Way:
    """How robots get lost: in streams of these kinds, carried or pushed or neither.

    event    "kidnap", "push", "log" (a kidnap in a log) or ""
    rates    scans a second, in turn; those of the kind where there are none
    layouts  in turn; by the seed where there are none
    """

    kinds: tuple[str, ...] = ()
    event: str = ""
    rates: tuple[float, ...] = ()
    layouts: tuple[str, ...] = ()

    @property
    def each(self) -> int:
        """Losses of a case."""
        return EACH if self.event else 1


def _kidnap(*kinds: str) -> Way:
    return Way(kinds=kinds, event="kidnap", layouts=DECIDABLE)


WAYS = {
    "chairs": Way(kinds=("chairs8", "chairs16", "chairs24", "wide270")),
    "boards": Way(kinds=("pass6", "pass10")),
    "herd": Way(kinds=("boards6", "boards10")),
    "crowd": Way(kinds=("crowd6", "crowd10", "crowd16")),
    "outdated": Way(kinds=("moved30_calm", "moved30", "moved15")),
    "alike": Way(kinds=("alike",)),
    "corridor": Way(kinds=("empty_corridor", "crowd_corridor")),
    "poor": Way(kinds=("poor",)),
    "rates": Way(kinds=("slow2hz", "fast37"), rates=(2.0, 5.0, 20.0, 37.0)),
    "kidnap": _kidnap("chairs8", "wide270"),
    "kidnap-crowd": _kidnap("crowd6", "crowd10"),
    "kidnap-moved": _kidnap("moved30_calm", "pass6"),
    "push": Way(kinds=("chairs16", "pass6", "crowd6"), event="push"),
    "log": Way(event="log"),
}
"""Every way by its name."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """One run: which way, the how-manieth case of it, which SLAM, seconds of the stream.

    log  the log of the way "log", else ""
    """

    way: str
    number: int
    slam: str
    first_seed: int
    seconds: float
    log: str = ""

    @property
    def spec(self) -> StreamSpec:
        """The stream of a case without a log: kinds in turn, then the next seed."""
        way = WAYS[self.way]
        turn, which = divmod(self.number, len(way.kinds))
        changes: list[tuple[str, float | int | str]] = []
        if way.rates:
            changes.append(("rate_hz", way.rates[self.number % len(way.rates)]))
        if way.layouts:
            changes.append(("layout", way.layouts[turn % len(way.layouts)]))
        return StreamSpec(
            kind=way.kinds[which],
            seed=self.first_seed + APART * list(WAYS).index(self.way) + turn,
            seconds=MAPPED_S if way.event == "kidnap" else self.seconds,
            changes=tuple(changes),
        )


def cases(
    names: Sequence[str], slams: Sequence[str], losses: int, first_seed: int, seconds: float,
    logs: Sequence[Path] = (),
) -> Iterator[Case]:  # fmt: skip
    """For at least ``losses`` losses of every way and SLAM, all ways in turn.

    The way "log" takes part where there are logs. ``InvalidValueError`` for a name of no way.
    """
    for name in names:
        if name not in WAYS:
            raise InvalidValueError(f"--ways must be of {', '.join(WAYS)}, got {name!r}")
    for number in range(losses):
        for name in names:
            way, log = WAYS[name], ""
            if number * way.each >= losses or (way.event == "log" and not logs):
                continue
            if way.event == "log":
                log = str(logs[number % len(logs)])
            for slam in slams:
                yield Case(
                    way=name, number=number, slam=slam, first_seed=first_seed, seconds=seconds,
                    log=log,
                )  # fmt: skip

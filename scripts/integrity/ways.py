# SPDX-License-Identifier: Apache-2.0
"""Ways in which a robot gets lost, and the cases of a campaign.

In a way without an event a stream is one loss: boards, crowds or rooms that changed do it. In the
others the robot is carried or pushed ``EACH`` times, each time with a copy of the SLAM that has
seen the stream so far.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
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
    about    in words
    """

    kinds: tuple[str, ...] = ()
    event: str = ""
    rates: tuple[float, ...] = ()
    layouts: tuple[str, ...] = ()
    about: str

    @property
    def each(self) -> int:
        """Losses of a case."""
        return EACH if self.event else 1


WAYS = {
    "chairs": Way(kinds=("chairs8", "chairs16", "chairs24", "wide270"), about="8 to 24 chairs"),
    "boards": Way(kinds=("pass6", "pass10"), about="6 or 10 boards that slide past"),
    "herd": Way(kinds=("boards6", "boards10"), about="6 or 10 boards that come along"),
    "crowd": Way(kinds=("crowd6", "crowd10", "crowd16"), about="6 to 16 people who walk along"),
    "outdated": Way(
        kinds=("moved30_calm", "moved30", "moved15"), about="everything moved out of sight"
    ),
    "alike": Way(kinds=("alike",), about="boards, and rooms that are alike after half a turn"),
    "corridor": Way(
        kinds=("empty_corridor", "crowd_corridor"),
        about="a bare corridor, its ends out of range, empty or with 10 people",
    ),
    "poor": Way(kinds=("poor",), about="61 beams, 30 mm of noise, 5 % of the returns missing"),
    "rates": Way(
        kinds=("slow2hz", "fast37"), rates=(2.0, 5.0, 20.0, 37.0), about="2 to 37 scans a second"
    ),
    "kidnap": Way(
        kinds=("chairs8", "wide270"), event="kidnap", layouts=DECIDABLE, about="carried elsewhere"
    ),
    "kidnap-crowd": Way(
        kinds=("crowd6", "crowd10"), event="kidnap", layouts=DECIDABLE,
        about="carried elsewhere, from one crowd into another",
    ),
    "kidnap-moved": Way(
        kinds=("moved30_calm", "pass6"), event="kidnap", layouts=DECIDABLE,
        about="carried elsewhere, where chairs and boards stand elsewhere too",
    ),
    "push": Way(
        kinds=("chairs16", "pass6", "crowd6"), event="push",
        about="pushed by 0.3 m or 5 degrees, which odometry does not notice",
    ),
    "log": Way(event="log", about="logs of real robots: put back to an earlier part"),
}  # fmt: skip
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


def named_ways(names: Sequence[str]) -> Mapping[str, Way]:
    """These of ``WAYS``; ``InvalidValueError`` for another name."""
    for name in names:
        if name not in WAYS:
            raise InvalidValueError(f"--ways must be of {', '.join(WAYS)}, got {name!r}")
    return {name: WAYS[name] for name in names}


def cases(
    names: Sequence[str], slams: Sequence[str], losses: int, first_seed: int, seconds: float,
    logs: Sequence[Path] = (),
) -> Iterator[Case]:  # fmt: skip
    """For at least ``losses`` losses of every way and SLAM, all ways in turn.

    The way "log" takes part where there are logs.
    """
    ways = named_ways(names)
    for number in range(losses):
        for name, way in ways.items():
            if number * way.each >= losses or (way.event == "log" and not logs):
                continue
            log = str(logs[number % len(logs)]) if way.event == "log" else ""
            for slam in slams:
                yield Case(
                    way=name, number=number, slam=slam, first_seed=first_seed, seconds=seconds,
                    log=log,
                )  # fmt: skip

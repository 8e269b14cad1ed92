# SPDX-License-Identifier: Apache-2.0
"""What was wrong with a log and could be put right: counted, said once, or refused."""

from __future__ import annotations

import logging
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from slam.errors import LogFormatError

_log = logging.getLogger(__name__)

TORN_LINE = "torn_last_line"
STAMPS_SORTED = "stamps_stepped_back"
STAMPS_SPREAD = "stamps_equal_spread"
CLOCK_STEPS = "clock_steps_back"
STRAY_STAMPS = "stamps_stray"
STAMPS_WRAPPED = "stamps_wrapped"
SHORT_ODOM = "odom_lines_without_speeds"
NO_ODOMETRY = "scans_with_assumed_odometry"
WORDS = {
    TORN_LINE: "{} torn end (a last line or object without its end) left out",
    STAMPS_SORTED: "{} stamps that step back by less than 1 s sorted by time",
    STAMPS_SPREAD: "{} scans with the time of another spread over the time there was",
    CLOCK_STEPS: "{} times the clock steps back by 1 s or more: order of the file kept",
    STRAY_STAMPS: "{} stamps far from their neighbours' replaced",
    STAMPS_WRAPPED: "{} stamps of 4.29497e+09 s (below 0, in 32 bits) put back where they were",
    SHORT_ODOM: "{} ODOM lines without speeds and host read as x y theta t",
    NO_ODOMETRY: "no odometry: {} scans with that of a constant velocity",
}


@dataclass
class Repairs:
    """Of one log, while it is read.

    strict  whether a repair is refused: ``note`` raises ``LogFormatError`` then
    counts  how many of each kind were made
    """

    path: Path
    strict: bool = False
    counts: Counter[str] = field(default_factory=Counter)

    def note(self, kind: str, why: str, line: int | None = None, count: int = 1) -> None:
        """One repair, or ``count`` of them; ``why`` is what a strict reader says."""
        if self.strict:
            raise LogFormatError(self.path, f"{why} (refused by --strict)", line)
        self.counts[kind] += count

    def facts(self) -> dict[str, int]:
        """The counts, of all kinds that most text logs can have, for ``StreamMetadata.extra``."""
        rare = (SHORT_ODOM, NO_ODOMETRY, STAMPS_WRAPPED)
        return {kind: self.counts[kind] for kind in WORDS if kind not in rare or self.counts[kind]}

    def warn(self) -> None:
        """Say all of them in one line, if there are any."""
        said = [
            words.format(self.counts[kind]) for kind, words in WORDS.items() if self.counts[kind]
        ]
        if said:
            _log.warning("%s repaired: %s", self.path, "; ".join(said))

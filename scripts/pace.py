# SPDX-License-Identifier: Apache-2.0
"""What will run, and about how long: from what such work took on this machine before.

The rates lie in the user's cache folder, in no result; who loses them loses estimates only.
"""

import json
import math
import os
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from statistics import median
from typing import NamedTuple

from scripts.console import in_time, say
from slam.checked import is_number
from slam.files import make_folder, write_text

KEPT = 0.6  # of a rate that is known, when a slower one is measured
MOST_KINDS = 1000  # in the file; the oldest go first
MOST_BYTES = 1 << 20


class Work(NamedTuple):
    """``amount`` (simulated s, MB or jobs) of one ``kind`` of work."""

    kind: str
    amount: float = 1.0


def state() -> Path:
    """Where the rates lie."""
    folder = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(folder) / "mobilia" / "pace.json"


def rates() -> dict[str, float]:
    """s of each amount of 1, by kind; none where there is no such file."""
    with suppress(OSError, ValueError, RecursionError, OverflowError):
        with state().open("rb") as file:
            found = json.loads(file.read(MOST_BYTES))
        if isinstance(found, dict):
            return {
                str(k): float(v) for k, v in found.items() if is_number(v) and 0.0 <= v < math.inf
            }
    return {}


def learn(spent: Iterable[tuple[Work, float]]) -> None:
    """Take in how many seconds each piece of work took. Where nothing can be kept, nothing is.

    What it took alone, that is. A faster one stands at once: a slower one may have compiled.
    """
    known = rates()
    for work, seconds in spent:
        rate = seconds / slower(1) / max(work.amount, 1e-9)
        before = known.pop(work.kind, rate)
        known[work.kind] = min(rate, KEPT * before + (1.0 - KEPT) * rate)
    with suppress(OSError):
        make_folder(state().parent)
        write_text(state(), json.dumps(dict(list(known.items())[-MOST_KINDS:])) + "\n")


@contextmanager
def timed(work: Work) -> Iterator[None]:
    """Learn how long the block takes, if it ends well."""
    started = time.perf_counter()
    yield
    learn([(work, time.perf_counter() - started)])


def estimate(works: Iterable[Work], processes: int = 1) -> float | None:
    """s; a kind that has not run here takes as long as the middle one of those like it, another
    SLAM's or scene's; None where there is none."""
    known = rates()
    each = [work.amount * known.get(work.kind, _like(work.kind, known)) for work in works]
    whole = max(sum(each) / max(processes, 1), max(each, default=0.0))
    return None if math.isnan(whole) else whole


def _like(kind: str, known: dict[str, float]) -> float:
    like = kind.rpartition(" ")[0]
    found = [rate for other, rate in known.items() if other.rpartition(" ")[0] == like]
    return median(found) if found else math.nan


def slower(processes: int, load: Path = Path("/proc/loadavg")) -> float:
    """How much longer all takes beside what else runs on these cores; 1 where nobody says."""
    with suppress(OSError, ValueError):
        mean, _, _, now, _ = load.read_text().split()
        others = min(float(mean), int(now.partition("/")[0]) - 1)  # not what has ended since
        return max(1.0, (others + processes) / (os.cpu_count() or 1))
    return 1.0


def announce(what: str, works: Iterable[Work], processes: int = 1) -> None:
    """Print what will run, and about how long that takes."""
    seconds, busy = estimate(works, processes), slower(processes)
    long = "how long is not known yet on this machine"
    if seconds is not None:
        long = f"about {in_time(seconds * busy)}" + " beside what else runs here" * (busy > 1.2)
    say(f"Ahead: {what}; {long}.", highlight=False)

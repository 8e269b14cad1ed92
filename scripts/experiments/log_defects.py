# SPDX-License-Identifier: Apache-2.0
"""Does a SLAM come through logs as they are found? ``python -m scripts.experiments.log_defects``.

Takes sound CARMEN logs, puts in one defect each that public logs have, reads them back and runs
``--slam`` on them. Prints the error against the log's corrected poses beside that on the sound log,
and what the reader warned of. A third of the way in, where the clock steps back, both sides are
of one log: poses are compared scan by scan, in the order of the file.

Exit status 1 where an error is more than a tenth off, or the reader did not say one line.
"""

from __future__ import annotations

import argparse
import logging
import sys
import tempfile
from collections.abc import Callable, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from scripts.console import console
from slam.evaluation import metrics
from slam.frames import Float, Frame
from slam.logs import open_log
from slam.logs.text import numbered_lines
from slam.replay import Track
from slam.system import create
from slam.trajectory import Trajectory

FLOOR_M = 0.002  # an error this near to the sound log's is the same, however small that is
WITHIN = 0.1  # of the sound log's error


def rounded(lines: list[str], digits: int = 4) -> list[str]:
    """Times printed with so few significant digits."""
    return [_retimed(line, lambda t: float(f"{t:.{digits}g}")) for line in lines]


def cut(lines: list[str]) -> list[str]:
    """The last scan cut in the middle; nothing after it."""
    last = max(k for k, line in enumerate(lines) if line.startswith("FLASER"))
    return [*lines[:last], lines[last][: len(lines[last]) // 2]]


def set_back(lines: list[str], by_s: float = 1.4) -> list[str]:
    """The clock set back a third of the way in."""
    third = len(lines) // 3
    return lines[:third] + [_retimed(line, lambda t: t - by_s) for line in lines[third:]]


DEFECTS: dict[str, Callable[[list[str]], list[str]]] = {
    "times rounded to 4 digits": rounded,
    "last line cut": cut,
    "clock set back by 1.4 s": set_back,
    "all three": lambda lines: cut(rounded(set_back(lines), 5)),
}


def _retimed(line: str, change: Callable[[float], float]) -> str:
    words = line.split()
    if words and words[0] in ("FLASER", "ODOM"):
        words[-3] = f"{change(float(words[-3])):.10g}"
    return " ".join(words) + "\n"


class Warned(logging.Handler):
    """Keeps what readers warn of."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """One more."""
        self.lines.append(record.getMessage())


def read(path: Path, most: int | None) -> tuple[list[Frame], list[str]]:
    """The frames and the warnings."""
    warned = Warned()
    logger = logging.getLogger("slam.logs")
    logger.addHandler(warned)
    try:
        return list(islice(open_log(path), most)), warned.lines
    finally:
        logger.removeHandler(warned)


def error_m(frames: Sequence[Frame], slam: str) -> float:
    """RMS position error of the final trajectory, aligned, m.

    By scan instead of by time: frames are given times 1 s apart for the comparison only.
    """
    track = Track(slam, create(slam))
    failed = track.survive(frames)
    if failed is not None:
        raise failed
    final = track.final() or track.online()
    truth = [f.truth for f in frames if f.truth is not None]
    stamps = np.arange(len(truth), dtype=np.int64) * 1_000_000_000
    pairs: list[Float] = [final.poses, np.array(truth)]
    return metrics.ate(*(Trajectory(stamps_ns=stamps, poses=p) for p in pairs), align="se2").value


def table(log: Path, slam: str, most: int | None) -> bool:
    """Print the rows of one log; whether all is well."""
    lines = [line + "\n" for _, line in numbered_lines(log)]
    frames, _ = read(log, most)
    sound = error_m(frames, slam)
    console.print(f"{log.name}: {len(frames)} scans, error {sound:.4f} m", soft_wrap=True)
    well = True
    with tempfile.TemporaryDirectory() as folder:
        for name, defect in DEFECTS.items():
            path = Path(folder) / "damaged.log"
            path.write_text("".join(defect(lines)))
            damaged, warnings = read(path, most)
            error = error_m(damaged, slam)
            good = len(warnings) == 1 and abs(error - sound) <= max(WITHIN * sound, FLOOR_M)
            well = well and good
            console.print(
                f"  {name:26} {len(damaged)} scans, error {error:.4f} m ({error / sound - 1:+.1%}) "
                f"{'' if good else 'NOT WELL'}", soft_wrap=True, highlight=False
            )  # fmt: skip
            for words in warnings:
                console.print(f"    {words.partition(' repaired: ')[2]}", soft_wrap=True)
    return well


def main(words: Sequence[str] | None = None) -> int:
    """The exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("logs", nargs="+", type=Path, help="CARMEN logs with corrected poses")
    parser.add_argument("--slam", default="shunting")
    parser.add_argument("--scans", type=int, help="only so many of each")
    options = parser.parse_args(words)
    well = [table(log, options.slam, options.scans) for log in options.logs]
    return 0 if all(well) else 1


if __name__ == "__main__":
    sys.exit(main())

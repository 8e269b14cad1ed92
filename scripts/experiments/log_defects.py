# SPDX-License-Identifier: Apache-2.0
"""Does a SLAM come through logs as they are found?

``python -m scripts.experiments.log_defects --log LOG [LOG ...]``. Takes sound CARMEN logs, puts in
one defect each that public logs have, reads them back and runs ``--slam`` on them. Told is the
error against the log's corrected poses beside that on the sound log, and what the reader warned of.
A third of the way in, where the clock steps back, both sides are of one log: poses are compared
scan by scan, in the order of the file. All is well where the errors are alike and the reader said
one line.
"""

from __future__ import annotations

import logging
import sys
import tempfile
from collections.abc import Callable, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from scripts.experiments.shared import Row
from scripts.experiments.study import Study
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


def run(case: Row) -> Row:
    """The errors, m, of the sound and of the damaged log, and what was warned of."""
    log, most = Path(case["log"]), case["scans"] or None
    frames, _ = read(log, most)
    lines = [line + "\n" for _, line in numbered_lines(log)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "damaged.log"
        path.write_text("".join(DEFECTS[case["defect"]](lines)))
        damaged, warnings = read(path, most)
    sound_m, found_m = (error_m(one, case["slam"]) for one in (frames, damaged))
    alike = abs(found_m - sound_m) <= max(WITHIN * sound_m, FLOOR_M)
    return {
        "read": len(damaged), "sound_m": sound_m, "found_m": found_m,
        "well": alike and len(warnings) == 1,
        "warned": [words.partition(" repaired: ")[2] for words in warnings],
    }  # fmt: skip


STUDY = Study(
    name="log_defects",
    axes={"log": ("intel-corrected.log.xz",), "defect": tuple(DEFECTS), "scans": (0,),
          "slam": ("shunting",)},
    run=run, data=lambda case: [Path(case["log"])], lines=("log", "defect", "slam"),
    columns={
        "scans": lambda rows: str(rows[0]["read"]),
        "error, m": lambda rows: f"{rows[0]['found_m']:.4f}",
        "to the sound log": lambda rows: f"{rows[0]['found_m'] / rows[0]['sound_m'] - 1:+.1%}",
        "all well": lambda rows: "yes" if rows[0]["well"] else "**no**",
        "the reader says": lambda rows: "; ".join(rows[0]["warned"]),
    },
    told="World {world}.", defaults={"seeds": 1, "first_seed": 0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())

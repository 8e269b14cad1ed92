# SPDX-License-Identifier: Apache-2.0
"""Text logs: what is usual in public ones."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from slam.frames import Frame
from tests.scripts.kinds.kind import Kind, read_log
from tests.slam.logs.conftest import CarmenText

MAKE, N, STEP_S = CarmenText(), 40, 0.5
POSES = MAKE.path_poses(N)
TIMES = [STEP_S * k for k in range(N)]


def _write(
    folder: Path, times: Sequence[float] = TIMES, form: str = "{:.6f}", cut: int = 0
) -> Path:
    """FLASER lines at these times, less so many letters of the last."""
    rows = []
    for k, pose in enumerate(POSES):
        word = form.format(times[k])
        row = MAKE.flaser(k, 0.0, pose, pose)
        rows.append(row.replace("0.000000 host 0.000000", f"{word} host {word}"))
    text = "".join(rows)
    (folder / "a.log").write_text(text[: len(text) - cut])
    return folder / "a.log"


def _short(folder: Path) -> Path:
    """ODOM lines of a pose and a time alone."""
    rows = []
    for k, pose in enumerate(POSES):
        rows += [f"ODOM {MAKE.words(pose)} {TIMES[k]:.6f}\n", MAKE.rawlaser(k, TIMES[k])]
    (folder / "a.log").write_text("".join(rows))
    return folder / "a.log"


def _followed(frames: Sequence[Frame], n: int = N, poses: Sequence[np.ndarray] = POSES) -> None:
    """All scans in their order, each where the log has it."""
    read = [frame.odometry.T_odom_robot for frame in frames]
    np.testing.assert_allclose(read, poses[:n], atol=1e-6)
    assert (np.diff([frame.stamp for frame in frames]) > 0.0).all()


def _repaired(
    name: str, done: str, said: str, write: Callable[[Path], Path], check: Callable = _followed
) -> Kind:
    return Kind(
        name=name, done=done, said=said, write=write, check=check, read=read_log, strict=True
    )


SWAPPED = [*TIMES[:20], TIMES[21], TIMES[20], *TIMES[22:]]
SORTED = [*POSES[:20], POSES[21], POSES[20], *POSES[22:]]
STRAY = [*TIMES[:20], 1e6, *TIMES[21:]]
KINDS = [
    _repaired(
        "the last line or object has no end", "it is left out",
        "1 torn end (a last line or object without its end) left out",
        partial(_write, cut=40), partial(_followed, n=N - 1),
    ),
    _repaired(
        "times so coarse that scans share one (`1.13486e+09`)",
        "they are spread by the odometry between the scans, over the time there was",
        "… scans with the time of another spread over the time there was",
        partial(_write, times=[1.13486e9 + t for t in TIMES], form="{:g}"),
    ),
    _repaired(
        "times that step back by less than 1 s", "the scans are sorted by time",
        "… stamps that step back by less than 1 s sorted by time",
        partial(_write, times=SWAPPED), partial(_followed, poses=SORTED),
    ),
    _repaired(
        "a clock that steps back by 1 s or more",
        "the order of the file is kept, and the clock goes on from where it was",
        "… times the clock steps back by 1 s or more: order of the file kept",
        partial(_write, times=[t - 5.0 * (k >= 20) for k, t in enumerate(TIMES)]),
    ),
    _repaired(
        "a time far from those around it", "it is replaced",
        "… stamps far from their neighbours' replaced", partial(_write, times=STRAY),
    ),
    _repaired(
        "times below 0 written in 32 bits without a sign (`4294967295.75`, `4.29497e+09`)",
        "they get their sign back; where the digits do not tell, they lie between those around "
        "them, in the order of the file",
        "… stamps of 4.29497e+09 s (below 0, in 32 bits) put back where they were",
        partial(_write, times=[(t - 6.0) % 2**32 for t in TIMES]),
    ),
    _repaired(
        "`ODOM` lines of CARMEN without speeds and host", "read as `x y theta t`, if all are so",
        "… ODOM lines without speeds and host read as x y theta t", _short,
    ),
]  # fmt: skip

# SPDX-License-Identifier: Apache-2.0
"""One run of the search: a SLAM on a recording, ended where it is lost, and its score."""

from pathlib import Path

import numpy as np

from scripts.comparison.recording import load
from scripts.metrics.judged import Judged
from slam.errors import InvalidValueError, SlamFailedError
from slam.guests import Limits, limited
from slam.interface import RunsAtTheEnd
from slam.oracle import shown
from slam.replay import Track
from slam.system import create
from slam.trajectory import Trajectory

LOOKS = 10  # scans between two looks whether it is lost: what comes after cannot change the score
FAILED = 2.0


def run(
    path: Path, *, recording: str, slam: str, scan_limit_s: float = Limits.scan_s, **_: bool
) -> None:
    """A job: the score of ``slam`` on the file ``recording``, and whether it was lost, to ``path``.
    What else a job of ``Plan.entries`` has is of maps, which are not judged here.

    The score is 0 to 2, less is better: the error in m where it held, at most 1; where it was lost
    1 and the share of the run that was left then; ``FAILED`` where it failed.
    """
    drive = load(path.parent.parent / recording)
    truth, track = drive.truth(), Track(name=slam, system=create("odometry"))
    score, lost = FAILED, True
    try:
        track.system = limited(slam, Limits(scan_s=scan_limit_s))
        at_once = not isinstance(track.system, RunsAtTheEnd)
        for k, frame in enumerate(drive.frames, 1):
            track.take(shown(track.system, frame))
            if at_once and k % LOOKS == 0 and _judged(track, truth).lost_s is not None:
                break
        online = _judged(track, truth)
        lost_s, lost = online.lost_s, online.lost_s is not None
        seconds = float(truth.stamps_ns[-1] - truth.stamps_ns[0]) / 1e9
        score = min(online.ate(), 1.0) if lost_s is None else 2.0 - min(lost_s / seconds, 1.0)
    except (SlamFailedError, InvalidValueError):
        pass  # the score of a failure, and of numbers that do not go together
    np.savez(path, score=score, lost=lost)


def _judged(track: Track, truth: Trajectory) -> Judged:
    return Judged(estimate=track.online(), truth=truth)

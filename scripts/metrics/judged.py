# SPDX-License-Identifier: Apache-2.0
"""A run as the metrics see it: poses beside their truth, and what the SLAM said on the way."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.errors import InvalidValueError
from slam.evaluation import lost, metrics
from slam.frames import NS_PER_S, Float, Frame
from slam.replay import Track
from slam.system import Estimate
from slam.trajectory import Trajectory

SILENT_M = 0.1  # m; a larger error that the SLAM does not admit is a silent failure
SILENT_SIGMAS = 3.0  # of its own covariance; an error within them is admitted
SETTLED_S = 5.0  # NEES counts after this: before, the covariance is that of the known first pose


def world_truth(frames: Sequence[Frame]) -> Trajectory:
    """The true poses of frames that have them, in the world."""
    return Trajectory(
        stamps_ns=np.array([frame.stamp_ns for frame in frames]),
        poses=np.array([frame.truth for frame in frames]),
    )


def in_first_frame(truth: Trajectory) -> Trajectory:
    """The truth as seen from its own first pose, the frame in which a SLAM starts."""
    return moved(truth, se2.inverse(truth.poses[0]))


def moved(path: Trajectory, T_to_from: Float) -> Trajectory:
    """The same in another frame."""
    poses = np.array([se2.compose(T_to_from, pose) for pose in path.poses]).reshape(-1, 3)
    return Trajectory(stamps_ns=path.stamps_ns, poses=poses)


@dataclass(frozen=True, kw_only=True, eq=False)
class Judged:
    """What a metric may be computed from.

    estimate     the poses that are judged: usually the online ones
    truth        beside them; None where there is none: only metrics ``without_truth`` are defined
    final        the poses as the SLAM sees them at the end; None where it revises nothing
    estimates    one a scan, with covariance and convergence
    covariances  (n, 3, 3) of the online poses
    steady_s     (n,) processor time of the updates that count for timings
    duration_s   of the run, recorded time
    """

    estimate: Trajectory
    truth: Trajectory | None
    final: Trajectory | None = None
    estimates: Sequence[Estimate] = ()
    covariances: Float | None = None
    steady_s: Float | None = None
    duration_s: float = math.nan

    @classmethod
    def of(
        cls, track: Track, truth: Trajectory | None, final: Trajectory | None = None
    ) -> "Judged":
        """The online poses of a track."""
        return cls(
            estimate=track.online(),
            truth=truth,
            final=final,
            estimates=track.estimates,
            covariances=track.covariances(),
        )

    @property
    def known(self) -> Trajectory:
        """The truth; ``InvalidValueError`` where there is none."""
        if self.truth is None:
            raise InvalidValueError("this metric needs a run with truth")
        return self.truth

    @cached_property
    def pairs(self) -> metrics.PoseErrors:
        """Errors, unaligned."""
        return metrics.pose_errors(self.estimate, self.known)

    @cached_property
    def statistics(self) -> metrics.ErrorStatistics:
        """The paper's mean(e), var(e), var(p)."""
        return metrics.error_statistics(self.estimate, self.known)

    @cached_property
    def lost_s(self) -> float | None:
        """Seconds from the start to the loss (``slam.evaluation.lost``); None for none."""
        both = self.pairs.distances, self.pairs.errors[:, 2]
        distances, headings = (np.where(self._excused, 0.0, off) for off in both)
        return lost.lost_at(self._seconds, distances, headings)

    @cached_property
    def _seconds(self) -> Float:
        return np.asarray((self.pairs.stamps_ns - self.known.stamps_ns[0]) / NS_PER_S)

    @cached_property
    def _excused(self) -> NDArray[np.bool_]:
        return lost.excused(self._seconds, self.pairs.truth[:, :2])

    def ate(self, align: metrics.Alignment = "none") -> float:
        """Absolute trajectory error, m."""
        return metrics.ate(self.estimate, self.known, align=align).value

    def rpe(self, per: metrics.Per, which: int) -> float | None:
        """Relative pose error, position (0) or heading (1); None where it did not drive so far."""
        try:
            return metrics.rpe(self.estimate, self.known, per=per)[which].value
        except InvalidValueError:
            return None

    def error_while_tracking(self) -> float | None:
        """Root mean square position error, m, up to the loss; None where it was lost at once.

        What follows a kidnapping is left out as long as it does not count for a loss.
        """
        end_s = math.inf if self.lost_s is None else self.lost_s
        counts = ~self._excused & (self._seconds < end_s)
        off = self.pairs.distances[counts]
        return math.sqrt(float((off * off).mean())) if len(off) else None

    def silent_share(self) -> float | None:
        """Of the scans, those ``SILENT_M`` off, beyond ``SILENT_SIGMAS`` of the covariance of
        position, and trusted by the SLAM; None where it claims nothing, as guests.
        """
        if self.covariances is None or not self.covariances.any():
            return None
        return float((self.is_off() & ~self.is_told()).mean())

    def is_off(self) -> NDArray[np.bool_]:
        """(n,) scans off by more than ``SILENT_M``."""
        return np.asarray(self.pairs.distances > SILENT_M)

    def converged(self) -> NDArray[np.bool_]:
        """(n,) scans whose pose the SLAM trusts."""
        return np.array([e.converged for e in self.estimates], dtype=np.bool_)

    def is_told(self) -> NDArray[np.bool_]:
        """(n,) scans that are not trusted, or off by less than ``SILENT_SIGMAS`` of the covariance
        of position; ``InvalidValueError`` for a run without covariances.
        """
        if self.covariances is None:
            raise InvalidValueError("this metric needs a run with covariances")
        off, P = self.pairs.errors[:, :2], self.covariances[:, :2, :2]
        # e' P^-1 e > 9 by the adjugate: true of a P that is singular and too small, too
        scaled = (
            P[:, 1, 1] * off[:, 0] ** 2
            - 2.0 * P[:, 0, 1] * off[:, 0] * off[:, 1]
            + P[:, 0, 0] * off[:, 1] ** 2
        )
        determinants = P[:, 0, 0] * P[:, 1, 1] - P[:, 0, 1] ** 2
        beyond = scaled >= SILENT_SIGMAS**2 * determinants
        return np.asarray(~(self.converged() & beyond))

    def protection_levels(self) -> Float:
        """(n,) ``SILENT_SIGMAS`` of the covariance of position in its worst direction, m;
        ``InvalidValueError`` for a run without covariances.
        """
        if self.covariances is None:
            raise InvalidValueError("this metric needs a run with covariances")
        P = self.covariances[:, :2, :2]
        half, across = 0.5 * (P[:, 0, 0] - P[:, 1, 1]), P[:, 0, 1]
        largest = 0.5 * (P[:, 0, 0] + P[:, 1, 1]) + np.sqrt(half * half + across * across)
        return np.asarray(SILENT_SIGMAS * np.sqrt(largest))

    def nees_over_3(self) -> float | None:
        """Mean after ``SETTLED_S``; None where the SLAM claims nothing, as guests."""
        if self.covariances is None:
            return None
        online = self.estimate
        settled = (online.stamps_ns - online.stamps_ns[0]) / NS_PER_S > SETTLED_S
        values = metrics.nees(online, self.covariances, self.known).values[settled]
        values = values[np.isfinite(values)]
        if len(values) == 0 or not values.mean() > 0.0:
            return None
        return float(values.mean()) / 3.0

    def milliseconds(self, percentile: float) -> float | None:
        """Of processor time a scan; None where no scan counts."""
        if self.steady_s is None or len(self.steady_s) == 0:
            return None
        return float(np.percentile(self.steady_s * 1e3, percentile))

    def real_time_factor(self) -> float | None:
        """Seconds recorded over seconds that the updates took; None where no scan counts."""
        if self.steady_s is None or len(self.steady_s) == 0:
            return None
        return self.duration_s / max(float(self.steady_s.mean()) * len(self.estimates), 1e-9)

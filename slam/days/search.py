# SPDX-License-Identifier: Apache-2.0
"""Where in the map of the days before a session starts.

The robot maps on its own, in a frame that begins where it stands, while the known map is searched
for what it sees. A place counts when it alone explains the present scan, and all that was seen
since the start agrees with the days before (``slam.days.agreement``), or, where the map has no
days, with the map. Nothing is written to the known map meanwhile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slam import se2
from slam.days.agreement import Past, Trial
from slam.days.alike import Alike
from slam.days.config import DaysConfig
from slam.estimate import Estimate
from slam.frames import NS_PER_S, Float, Frame, to_s
from slam.frontend.observations import Observations, observe
from slam.frontend.odometry_prior import Prediction
from slam.tracker.rasterise import rasterise
from slam.tracker.tracker import Tracker
from slam.tracker.tracking.relocalise import coarse, in_view, spread


@dataclass(frozen=True, kw_only=True, eq=False)
class Kept:
    """A scan of the search: what it saw, where in its own frame, and s since the one before."""

    observations: Observations
    T_own_robot: Float
    elapsed: float


class StartSearch:
    """Maps alone and searches the known map, until the start is found.

    alone  the SLAM that maps meanwhile    denied  places found that the rest denied
    seen   scans to be counted when the place is found, and the poses in the session's own frame
    """

    def __init__(self, known: Tracker, config: DaysConfig, past: Past) -> None:
        self._known, self._config, self._past = known, config.search, past
        self._every_ns = round(config.evidence.every_s * NS_PER_S)
        self._trial: Trial | None = None
        self._alike = Alike(past, config.alike) if past.known else None
        self._alike_since: tuple[float, float] | None = None  # way m, time s, of the last answer
        self.seen: list[tuple[Frame, Float]] = []
        self.alone = type(known)(known.config)
        self.alone.hold_map()
        self.elapsed_s, self.denied = 0.0, 0
        self._way_m = 0.0  # driven while scans were kept
        self._search = known.relocalisation()
        self._before: tuple[int, Float] | None = None
        self._kept: list[Kept] = []
        self._kept_s = 0.0

    def take(self, frame: Frame) -> tuple[Estimate, Float | None]:
        """The estimate in the session's own frame, and T_map_own (3,) when the place is found."""
        estimate = self.alone.update(frame)
        now, pose = frame.stamp_ns, estimate.T_map_robot
        before_ns, before = self._before or (now, pose)
        elapsed = to_s(now - before_ns)
        self._before = (now, pose)
        self.elapsed_s += elapsed
        observations = observe(frame, self._twist(frame, before, pose, elapsed), self._known.config)
        if not estimate.converged or not len(observations.points_robot):
            self._begin_again(estimate)
            return estimate, None
        self._keep(observations, pose, elapsed)
        self._way_m += float(np.hypot(*(pose - before)[:2]))
        if not self.seen or now - self.seen[-1][0].stamp_ns >= self._every_ns:
            self.seen.append((frame, pose))
        prediction = Prediction(
            T_map_robot=pose,
            increment=se2.between(before, pose),
            covariance=spread(self._config.step_m, self._config.step_rad),
            twist=np.zeros(3),
            elapsed=elapsed,
        )
        usual = self._known.usual_support()
        match = self._search.step(observations, prediction, None, usual, carried=True)
        if match is None:
            return estimate, None
        T_map_own = se2.compose(match.T_map_robot, se2.inverse(pose))
        agrees = self._tried(T_map_own) if self._past.known else self._agrees(T_map_own, usual)
        if agrees:
            return estimate, T_map_own
        if agrees is False:
            self.denied += 1
            self._trial, self._search = None, self._known.relocalisation()
        return estimate, None

    def _tried(self, T_map_own: Float) -> bool | None:
        """Whether all that was seen agrees with the days before; None: not known yet."""
        if self._trial is None or not self._trial.is_at(T_map_own):
            self._trial = Trial(self._past, T_map_own)
        found, config = self._trial.agreement(self.seen), self._past.config
        if found.known < config.known:
            return None
        if found.disagrees > config.denies:
            return False
        if self._way_m >= config.on_m:
            fits = found.disagrees <= config.accepts
        else:
            fits = self.elapsed_s >= config.on_s and found.disagrees <= config.stood
        alike = fits and self._is_alike(self._trial, T_map_own, found.disagrees)
        return True if fits and not alike else None

    def _is_alike(self, trial: Trial, T_map_own: Float, disagrees: float) -> bool:
        """Whether the session would fit the days before at another place, too.

        A yes is kept until the robot has driven on, or some time has passed.
        """
        assert self._alike is not None  # there are days
        numbers, since = self._alike.config, self._alike_since
        if since is not None:
            way_m, elapsed_s = since
            moved = self._way_m - way_m >= numbers.every_m
            if not moved and self.elapsed_s - elapsed_s < numbers.every_s:
                return True
        others = self._alike.others(trial.taken(), T_map_own)
        most = disagrees + numbers.more
        asked = (Trial(self._past, one).agreement(self.seen) for one in others)
        known = self._past.config.known
        alike = any(o.known >= known and o.disagrees <= most for o in asked)
        self._alike_since = (self._way_m, self.elapsed_s) if alike else None
        return alike

    def _begin_again(self, estimate: Estimate) -> None:
        """Its own map is in doubt: motion and kept scans are worth nothing from before."""
        if estimate.diagnostics.get("state") == "lost":
            self._search, self._trial = self._known.relocalisation(), None
            self._kept.clear()
            self.seen.clear()
            self._way_m, self._alike_since = 0.0, None

    @staticmethod
    def _twist(frame: Frame, before: Float, pose: Float, elapsed: float) -> Float:
        if frame.odometry.twist is not None:
            return np.asarray(frame.odometry.twist)
        return se2.between(before, pose) / elapsed if elapsed > 0.0 else np.zeros(3)

    def _keep(self, observations: Observations, pose: Float, elapsed: float) -> None:
        """Keep the scan if the robot has moved on; the oldest go."""
        self._kept_s += elapsed
        if self._kept:
            x, y, turn = se2.between(self._kept[-1].T_own_robot, pose).tolist()
            config = self._config
            if math.hypot(x, y) < config.buffer_m and abs(turn) < config.buffer_rad:
                return
        self._kept.append(Kept(observations=observations, T_own_robot=pose, elapsed=self._kept_s))
        self._kept_s = 0.0
        del self._kept[: -self._config.buffer]

    def _agrees(self, T_map_own: Float, usual: float) -> bool:
        """Whether the kept scans that the known map has a say on agree with the start there.

        Where the session began in a room that the map does not know, only later ones are.
        """
        config = self._config
        asked = self._kept[:: max(1, len(self._kept) // config.asked)]
        said = [support for one in asked if (support := self._support(one, T_map_own)) is not None]
        enough = len(said) > 0 and len(said) >= config.said * len(asked)
        return enough and float(np.mean(said)) >= config.agreed * usual

    def _support(self, one: Kept, T_map_own: Float) -> float | None:
        """Of a kept scan; None where next to nothing of the known map is in its view."""
        known, observations = self._known, one.observations
        covariance = coarse(known.config.tracking.relocalise)
        at = se2.compose(T_map_own, one.T_own_robot)
        match = known.matched(observations, at, covariance)
        confirmed, contradicted = in_view(known.cell_map, observations, match)
        total = confirmed + contradicted
        if total < self._config.in_view * float(observations.weights.sum()):
            return None
        return match.matched * confirmed / total

    def merge(self, T_map_own: Float) -> int:
        """Let the known map see the kept scans from where they were; how many."""
        known, cell_map = self._known, self._known.cell_map
        for one in self._kept:
            at = se2.compose(T_map_own, one.T_own_robot)
            rasterise(cell_map, one.observations, at)
            T_map_laser = se2.compose(at, one.observations.T_robot_laser)
            step = min(max(one.elapsed, 1e-3), known.config.map.longest_look_s)
            cell_map.integrate(one.observations.view, T_map_laser, step, write=True)
        return len(self._kept)

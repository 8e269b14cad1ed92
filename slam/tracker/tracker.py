# SPDX-License-Identifier: Apache-2.0
"""A SLAM on a map of cells, whatever the map: scan matching, uncertainty, relocalisation, loops."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.errors import InvalidValueError, LogFormatError
from slam.estimate import Estimate
from slam.frames import Float, Frame, Odometry
from slam.frontend import odometry_steps
from slam.frontend.observations import Observations, observe
from slam.frontend.odometry_prior import Prediction, inverted, turned
from slam.frontend.range_error import RangeError
from slam.path import PosePath
from slam.tracker import map_file as memory
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.learnt_ranges import LearntRanges
from slam.tracker.matching.matcher import Match, Matcher, unmatched
from slam.tracker.rasterise import rasterise
from slam.tracker.standing.agreement import Agreement
from slam.tracker.standing.recent import Standing
from slam.tracker.standing.rival import Rival
from slam.tracker.tracking.loops import Loops
from slam.tracker.tracking.quality import TrackingQuality
from slam.tracker.tracking.recovery import Recovery
from slam.tracker.tracking.relocalise import Relocalisation, coarse
from slam.tracker.tracking.scan_matching import ScanMatching
from slam.tracker.tracking.shove import slip
from slam.tracker.tracking.verdict import Verdict
from slam.tracker.uncertainty.odometry_noise import OdometryNoise
from slam.tracker.uncertainty.pose_covariance import PoseCovariance
from slam.tracker.uncertainty.residuals import Evidence, look
from slam.tracker.warmup import warm_up
from slam.trajectory import Trajectory


class Tracker(abc.ABC):
    """Localise on a map of cells, then let the map see the frame.

    ``config`` is a ``config_class``, the name of a preset, "robust" (default) or "paper", or
    numbers by their path in the tree, ``{"matching.reward": 7}``. Raises ``InvalidValueError`` for
    frames without observations or out of order.
    """

    config_class: ClassVar[type[TrackerConfig]]
    map_moves: ClassVar[bool] = True  # with the loops that are closed, if the config says so

    def __init__(self, config: TrackerConfig | str | Mapping[str, Any] = "robust") -> None:
        self.config = self.config_class.of(config)
        # mypy takes a class of dataclasses for unhashable
        warm_up(self.config_class, self._new_map)  # type: ignore[arg-type]
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next frame is the origin of the map."""
        self.cell_map = self._new_map(self.config)
        self._matcher = Matcher(self.config)
        self._before: Odometry | None = None
        self._resumed: Float | None = None
        self._T_map_robot: Float = np.zeros(3)
        self._numbers = self.config.tracking
        self._pose_covariance = PoseCovariance(self.config)
        self._odometry_noise = OdometryNoise.of_beams(self.config)
        self._quality = TrackingQuality(self.config.freeze_below, self._numbers.quality)
        self._matching = ScanMatching(self.config, self._matcher, self._quality)
        self._verdict = Verdict(self._numbers.verdict)
        self._recovery = Recovery(
            self.config, self._matcher, self._match, self._quality, self._verdict
        )
        new_map = partial(self._new_map, self.config) if self.map_moves else None
        self._loops = Loops(self.config, self._matcher, self._new_submap, new_map)
        self._T_map_odom, self._corrected_by = np.zeros(3), np.zeros(3)
        self._held = self._found = False  # the map; the robot, by a search, in this scan
        self._standing = Standing(self.config.standing)
        self._agreement = Agreement(self.config.standing)
        self._rival = Rival(self._matcher, self._standing)
        self._vote, self._dragged = 1.0, 0.0
        self._trusted = True  # the pose of the frame before
        empty = partial(self._new_map, self.config)
        learns = self.config.range_error.learn == "on"
        self._ranges = LearntRanges(self.config, self._matcher, empty) if learns else None
        self._path = PosePath()

    @staticmethod
    @abc.abstractmethod
    def _new_map(config: Any) -> CellMap:
        """An empty map of the SLAM's own."""

    def _new_submap(self) -> CellMap:
        """An empty map for what the key frames of a loop saw."""
        return self._new_map(self.config)

    def update(self, frame: Frame) -> Estimate:
        """One frame in seven steps: from odometry and scan to pose, covariance and map.

        Before them, a bounded part of the search for loops. A correction that is ready moves map
        and pose then; ``diagnostics`` say so: "correction" and "T_map_odom" (docs/loops.md).
        Not converged while frozen, lost, or blind: a scan without a single return.
        """
        if self._before is None and self._resumed is None:
            return self._first(frame)
        self._path.check_order(frame.stamp_ns)
        self._found = False
        self._correct()
        prediction = self._predict(frame.odometry)  # 1 odometry prior
        seen = frame if self._ranges is None else self._ranges.seen(frame)
        observations = observe(seen, prediction.twist, self.config)  # 2 de-skewed points, view
        votes = self._standing.votes(
            frame.stamp_ns, prediction.T_map_robot, prediction.prior, observations
        )
        observations = observations.with_votes(votes)
        self._vote = observations.mean_vote
        prediction, match, state = self._localise(
            frame.stamp_ns, observations, prediction
        )  # 3 Eq. (13)
        evidence = self._compare(observations, match, prediction, state)  # 4 residuals
        match, state = self._update_map(observations, match, prediction, state)  # 5 Eq. (8)
        self._update_uncertainty(
            observations, prediction, match, evidence, state
        )  # 6 pose, odometry noise
        self._add_to_path(observations, match, prediction, state)  # 7 key frames for loops
        if state == "tracking" or self._recovery.wake is not None:
            self._standing.add(frame.stamp_ns, match.T_map_robot, observations)
        if self._ranges is not None:
            tracked = state == "tracking" and not match.slipped
            self._ranges.learn(frame, prediction.twist, match.T_map_robot, tracked=tracked)
        return self._report(frame, match, state)

    def _first(self, frame: Frame) -> Estimate:
        twist = frame.odometry.twist
        moving = np.zeros(3) if twist is None else np.asarray(twist)
        observations = observe(frame, moving, self.config)
        rasterise(self.cell_map, observations, self._T_map_robot)
        T_map_laser = se2.compose(self._T_map_robot, observations.T_robot_laser)
        first_s = self.config.map.first_look_s
        self.cell_map.integrate(observations.view, T_map_laser, first_s, write=True)
        match = unmatched(np.zeros(3), matched=1.0, score=0.0)
        self._loops.add(0, match.T_map_robot, np.zeros(3), np.zeros((3, 3)), observations)
        self._standing.add(frame.stamp_ns, match.T_map_robot, observations)
        if not len(observations.points_robot):
            self._verdict.see_nothing()
        return self._report(frame, match, "tracking" if len(observations.points_robot) else "blind")

    def _correct(self) -> None:
        """Search for loops; move into the map that they have corrected, if it is ready."""
        self._corrected_by = np.zeros(3)
        self._loops.work()
        if not self._trusted or self._recovery.active or self._held or self._resumed is not None:
            return
        correction = self._loops.correction(self._path.poses)
        if correction is None and self._ranges is not None:
            correction = self._ranges.correction(self._loops, self._path.poses)
        if correction is None:
            return
        self.cell_map = correction.cell_map
        before, T = self._T_map_robot, correction.T_new_old
        self._T_map_robot = se2.compose(T, before)
        self._T_map_odom = se2.compose(T, self._T_map_odom)
        self._corrected_by = self._T_map_robot - before
        self._corrected_by[2] = se2.wrap(float(self._corrected_by[2]))
        self._path.replace(correction.poses)
        self._standing.moved(T)
        if self._ranges is not None:
            self._ranges.forget_views()
        self._pose_covariance.turned(float(T[2]))
        self._rival.forget()
        self._agreement.forget()

    def _predict(self, odometry: Odometry) -> Prediction:
        """By odometry; on the first frame with a loaded map, where the robot was before."""
        if self._before is not None:
            return self._odometry_noise.predict(self._T_map_robot, self._before, odometry)
        assert self._resumed is not None
        return Prediction(
            T_map_robot=self._T_map_robot,
            increment=np.zeros(3),
            covariance=self._resumed,
            twist=np.zeros(3) if odometry.twist is None else np.asarray(odometry.twist),
            elapsed=self.config.map.resumed_look_s,
        )

    def _localise(
        self, stamp_ns: int, observations: Observations, prediction: Prediction
    ) -> tuple[Prediction, Match, str]:
        """The pose by scan matching, or by relocalisation where the robot was lost; the state.

        The prior comes back wider where enough is in view to correct what odometry alone gave for
        the pose before, and after a slip.
        """
        if observations.weight >= self._numbers.relocalise.least_weight:
            motion = prediction.T_map_robot - self._T_map_robot
            prediction = replace(prediction, carried=self._pose_covariance.odometry_part(motion))
        if self._recovery.search is not None:
            self._rival.forget()
            match, state = self._recover(self._recovery.search, observations, prediction)
            return prediction, match, state
        match = _near(self._match(observations, prediction), prediction)
        quality = self._quality
        if quality.suspicious and match.matched < quality.least_continuous():
            self._rival.forget()  # it was carried farther than a second pose may be off
        else:
            match = self._rival.decided(self.cell_map, stamp_ns, observations, prediction, match)
        if match.slipped:
            prediction = replace(prediction, covariance=slip(self._numbers.relocalise))
        return prediction, match, "tracking"

    def _match(
        self, observations: Observations, prediction: Prediction, wake: CellMap | None = None
    ) -> Match:
        """By scan matching; ``wake``: to match to in the place of the map."""
        cell_map = self.cell_map if wake is None else wake
        return self._matching.match(cell_map, observations, prediction)

    def _recover(
        self, search: Relocalisation, observations: Observations, prediction: Prediction
    ) -> tuple[Match, str]:
        """Dead reckoning, until the robot is found or the map is outdated where it is."""
        match, state, self.cell_map, self._found = self._recovery.recover(
            search, self.cell_map, self._T_map_robot, observations, prediction
        )
        if self._found:
            self._pose_covariance.relocated(coarse(self._numbers.relocalise))
        return match, state

    def _compare(
        self, observations: Observations, match: Match, prediction: Prediction, state: str
    ) -> Evidence | None:
        """What the observed surfaces say about the pose, before the map takes them in."""
        if state != "tracking":
            return None
        short_term = self._matcher.reward.short_term
        step, turn = min(prediction.elapsed, self.config.map.longest_look_s), len(self._path)
        return look(self.cell_map, short_term, observations, match.T_map_robot, step, turn)

    def _update_map(
        self, observations: Observations, match: Match, prediction: Prediction, state: str
    ) -> tuple[Match, str]:
        """Let the map see the frame, unless the map in view contradicts it; match and state."""
        if state != "tracking":
            return match, state
        if self._rival.undecided:
            self._recovery.skip()
            return match, "frozen"
        rasterise(self.cell_map, observations, match.T_map_robot)
        T_map_laser = se2.compose(match.T_map_robot, observations.T_robot_laser)
        step = min(prediction.elapsed, self.config.map.longest_look_s)
        quality, denied = self._quality, False
        enough = self._numbers.relocalise.least_weight
        if observations.weight >= enough and quality.arises(match.matched):
            confirmed, contradicted, _ = self.cell_map.integrate(
                observations.view, T_map_laser, step, write=False
            )
            motion = match.T_map_robot - self._T_map_robot
            denied = quality.denied(match.matched, confirmed, contradicted, motion)
            support = match.overlapped * confirmed / max(confirmed + contradicted, 1e-9)
            denied = denied and not quality.excuses(support)
        quality.count(denied)
        if denied and quality.scans <= quality.config.patience:
            self.cell_map.release()
            match = self._recovery.deny(
                self.cell_map, self._T_map_robot, observations, prediction, match
            )
            self._judge(observations, match, confirmed, contradicted)
            self._recovery.suspect(self.cell_map, observations, prediction)
            return match, "lost" if quality.scans > quality.config.lost_after else "frozen"
        self._recovery.end()
        confirmed, contradicted, _ = self.cell_map.integrate(
            observations.view, T_map_laser, step, write=True
        )
        self._judge(observations, match, confirmed, contradicted)
        if len(observations.points_robot) == 0:
            return match, "lost" if denied else "blind"  # odometry alone
        if not denied:
            elapsed = prediction.elapsed
            quality.learn(match.matched, confirmed, contradicted, elapsed, match.overlapped)
        return match, "lost" if denied else "tracking"

    def _judge(
        self, observations: Observations, match: Match, confirmed: float, contradicted: float
    ) -> None:
        """Whether the robot is lost, or the map in view outdated."""
        total, enough = confirmed + contradicted, self._numbers.relocalise.least_weight
        few = observations.weight < enough or total == 0.0
        if len(observations.points_robot) == 0:
            self._verdict.see_nothing()
        elif few or not self._quality.suspicious:
            self._verdict.trust()
        else:
            share = confirmed / total
            whole = match.overlapped * share / self._quality.usual_whole()
            voting = match.matched * share / self._quality.usual_support()
            self._verdict.take(max(whole, voting), ratio=self._agreement.ratio, vote=self._vote)

    def _update_uncertainty(
        self,
        observations: Observations,
        prediction: Prediction,
        match: Match,
        evidence: Evidence | None,
        state: str,
    ) -> None:
        self._pose_covariance.update(self._T_map_robot, prediction, match, evidence)
        self._dragged = 0.0
        if state == "tracking" and not match.slipped:
            self._agreement.take(prediction, match.T_map_robot)
            self._dragged = self._agreement.dragged(self._vote)
            left_behind = self._agreement.left_behind(self._dragged)
            self._pose_covariance.dragged(left_behind, self._agreement.covariance(self._dragged))
        else:
            if not match.slipped:
                dragged = self._agreement.dragged(self._vote)
                self._pose_covariance.dragged(self._agreement.covariance(dragged))
            self._agreement.forget()
            if match.slipped:  # found by a search, among what does not fit there
                found = (1.0 - match.overlapped) * coarse(self._numbers.relocalise)
                self._pose_covariance.dragged(found)
        if state == "tracking" and not match.slipped:
            self._odometry_noise.learn(prediction, match, observations.sensor_sigma_m)
        else:
            self._odometry_noise.skip()

    def _add_to_path(
        self, observations: Observations, match: Match, prediction: Prediction, state: str
    ) -> None:
        """For closing loops: motion as matched, or by odometry where an end of it is uncertain."""
        motion = se2.between(self._T_map_robot, match.T_map_robot)
        covariance, written = self._pose_covariance.newest_drift, state == "tracking"
        if state == "relocated":  # carried away, or odometry was right: loops decide
            off = match.T_map_robot - prediction.T_map_robot
            off[2] = se2.wrap(float(off[2]))
            covariance = prediction.covariance + coarse(self._numbers.relocalise)
            covariance = covariance + np.diag(off * off)
        elif self._recovery.followed:
            covariance = prediction.covariance  # matched to the scans before, if not to the map
        elif state != "tracking" or not self._trusted:
            motion, covariance = prediction.increment, prediction.covariance
        self._trusted = state in ("tracking", "relocated")
        covariance = turned(covariance, -float(self._T_map_robot[2]))
        everyone = observations.with_votes(None)
        self._loops.add(
            len(self._path), match.T_map_robot, motion, covariance, everyone,
            elapsed=prediction.elapsed, written=written, found=self._found,
        )  # fmt: skip

    def _report(self, frame: Frame, match: Match, state: str) -> Estimate:
        self._before = frame.odometry
        self._T_map_robot = match.T_map_robot
        self._path.add(frame.stamp_ns, match.T_map_robot)
        return Estimate(
            stamp_ns=frame.stamp_ns,
            T_map_robot=match.T_map_robot,
            covariance=self._covariance(match.T_map_robot, state),
            converged=state in ("tracking", "relocated") and not self._doubtful(),
            diagnostics={
                "state": state,
                "matched": match.matched,
                "searched": match.searched,
                "evaluations": match.evaluations,
                "unobservable": self._pose_covariance.unobservable,
                "unobservable_rad": self._pose_covariance.along_rad,
                "nis": self._odometry_noise.nis,
                "trust": self._vote * (1.0 - self._dragged),
                "odometry_ratio": self._agreement.ratio,
                "verdict": self._verdict.word,
                "p_lost": self._verdict.p_lost,
                "correction": self._corrected_by.tolist(),
                "T_map_odom": self._T_map_odom.tolist(),
            },
        )

    def _covariance(self, T_map_robot: Float, state: str) -> Float:
        """(3, 3) of the pose; of a robot that may be lost, it may be anywhere that it has seen."""
        covariance = self._pose_covariance.covariance
        if state in ("frozen", "lost"):
            covariance = covariance + self._verdict.p_lost * self._loops.anywhere(T_map_robot)
        return covariance

    def _doubtful(self) -> bool:
        """Whether the crowd may have carried the robot far."""
        doubtful_m = self.config.standing.doubtful_m
        return 0.0 < doubtful_m < self._agreement.off_m(self._dragged)

    @property
    def learnt_error(self) -> RangeError | None:
        """What is known of the scanner's systematic error; None where that is switched off."""
        return None if self._ranges is None else self._ranges.error

    def displace(self, by: Float) -> None:
        """For experiments: from now on the pose is believed to be off by ``by`` (3,), map frame.

        As after a slip that nobody noticed: covariance, map and all that was kept of earlier scans
        stay as they are.
        """
        self._T_map_robot = self._T_map_robot + by
        self._T_map_robot[2] = se2.wrap(float(self._T_map_robot[2]))

    def window(
        self, xmin: float, ymin: float, xmax: float, ymax: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Dense short-term x and long-term y of the cells centred in the rectangle (map, m)."""
        return self.cell_map.window(xmin, ymin, xmax, ymax)

    def place(self, T_map_robot: Float, covariance: Float) -> None:
        """Take the next frame near this pose in the map, off by as much as ``covariance`` says.

        For a map that was loaded: odometry and clock begin anew.
        """
        self._T_map_robot, self._resumed, self._before = T_map_robot, covariance, None
        self._pose_covariance.resumed(covariance)

    def usual_support(self) -> float:
        """Of all returns where the robot was not lost: what a place must explain to be right."""
        return self._quality.usual_whole()

    def matched(self, observations: Observations, T_map_robot: Float, covariance: Float) -> Match:
        """The match to the map as it is, from this pose on, off by as much as that."""
        start = self._matcher.approach(self.cell_map, observations, T_map_robot, covariance)
        precision = inverted(covariance)
        return self._matcher.climb(self.cell_map, observations, start, T_map_robot, precision)

    def relocalisation(self) -> Relocalisation:
        """A search for the robot in the map as it is now."""
        return Relocalisation(self.cell_map, self._matcher)

    def save(self, path: Path, extra: Mapping[str, NDArray[Any]] | None = None) -> None:
        """Write map, knobs and pose to a file for ``load``; raises ``OutputError``.

        ``extra`` arrays lie beside them, for ``map_file.read_extra``.
        """
        state = memory.State(
            kind=type(self).__name__,
            T_map_robot=self._T_map_robot,
            covariance=self._pose_covariance.covariance,
            usual=tuple(self._quality.matches),
            supports=tuple(self._quality.supports),
            tracked_s=self._quality.tracked_s,
            tracked=self._quality.tracked,
        )
        memory.save(path, self.cell_map, state, extra)

    @classmethod
    def load(cls, path: Path) -> Self:
        """A SLAM that goes on in the map of a file, with new odometry and a new clock.

        The robot is looked for around where it was, then in the whole map. The trajectory begins
        with the first frame. Raises ``LogFormatError`` for a file that is not one of ``save``.
        """
        config, state, arrays = memory.read(path, cls.config_class)
        if state.kind != cls.__name__:
            raise LogFormatError(path, f"a map of {state.kind}, not of {cls.__name__}")
        slam = cls.__new__(cls)
        slam.config = config
        warm_up(cls.config_class, cls._new_map)  # type: ignore[arg-type]
        slam.reset()
        try:
            memory.fill(slam.cell_map, arrays)
        except InvalidValueError as error:  # blocks farther apart than a map can be
            raise LogFormatError(path, str(error)) from error
        slam._T_map_robot = state.T_map_robot
        slam._resumed = state.covariance + coarse(config.tracking.relocalise)
        slam._pose_covariance.resumed(state.covariance)
        slam._quality.resume(state.usual, state.supports, state.tracked_s, state.tracked)
        return slam

    def hold_map(self) -> None:
        """The map is a frame of reference from now on: closed loops do not move it."""
        self._held = True
        self._loops.hold()

    def poses_in_map(self) -> Float:
        """(n, 3) of all frames so far in the map as it is now: moved with it by each correction."""
        return self._path.poses()

    def trajectory(self) -> Trajectory:
        """The poses moved with the loops found so far where they tear the map, else as online."""
        return self._path.trajectory(self._loops.corrected(self._path.poses()))


def _near(match: Match, prediction: Prediction) -> Match:
    """The match, or odometry alone where rounding has carried it past all places and numbers."""
    off = np.abs(match.T_map_robot - prediction.T_map_robot)
    if off.max() <= odometry_steps.MOST_STEP_M and np.isfinite(match.information).all():
        return match
    return unmatched(prediction.T_map_robot, matched=0.0, score=0.0)

# SPDX-License-Identifier: Apache-2.0
"""A SLAM on a map of cells, whatever the map: scan matching, uncertainty, relocalisation, loops."""

import abc
import functools
import gc
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam._jit import announced
from slam.arrays import Float, Float32
from slam.errors import InvalidValueError, LogFormatError
from slam.estimate import Estimate
from slam.frames import Frame, Odometry
from slam.frontend.observations import Observations, observe
from slam.frontend.odometry_prior import Prediction, turned
from slam.path import PosePath
from slam.tracker import map_file as memory
from slam.tracker import warmup
from slam.tracker.belief.belief import Belief, Judged
from slam.tracker.belief.places import coarse
from slam.tracker.belief.state import State
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import MOST_OFF
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.matcher import Match, Matcher, unmatched
from slam.tracker.rasterise import rasterise
from slam.tracker.scanners import Scanners
from slam.tracker.standing.config import StandingConfig
from slam.tracker.standing.recent import Standing
from slam.tracker.tracking.loops import Loops
from slam.tracker.uncertainty.odometry_noise import OdometryNoise
from slam.tracker.uncertainty.pose_covariance import PoseCovariance
from slam.tracker.uncertainty.residuals import Residuals, residuals_of
from slam.trajectory import Trajectory


class Tracker(abc.ABC):
    """Localise on a map of cells, then let the map see the frame.

    ``config`` is a ``config_class``, the name of a preset, "robust" (default) or "paper", or
    numbers by their path in the tree, ``{"matching.reward": 7}``. Raises ``InvalidValueError`` for
    frames without observations or out of order.
    """

    config_class: ClassVar[type[TrackerConfig]]
    takes_several: ClassVar[bool] = True
    map_moves: ClassVar[bool] = True  # with the loops that are closed, if the config says so

    def __init__(self, config: TrackerConfig | str | Mapping[str, Any] = "robust") -> None:
        self.config = self.config_class.of(config)
        self._get_ready()
        self.reset()

    @classmethod
    def _get_ready(cls) -> None:
        """Compile, the first time in a process; a class without a config of its own as its base."""
        ours = (kind for kind in cls.__mro__ if issubclass(kind, Tracker))
        next(kind for kind in ours if "config_class" in vars(kind))._rehearse()

    @classmethod
    @functools.cache
    def _rehearse(cls) -> None:
        """Run every kernel once on a little room."""
        slam = cls.__new__(cls)
        slam.config = cls.config_class(cell_m=0.2, standing=StandingConfig(thin_m=0.0))
        with announced("the SLAM's kernels", warmup.COMPILE_S):
            slam.reset()
            for k in range(4):
                slam.update(warmup.frame(k))
            warmup.search(slam.cell_map, slam._new_submap(slam.config), slam._matcher)
        gc.collect()
        gc.freeze()  # the compiler's objects stay: looking through them takes 100 ms of a scan

    def reset(self) -> None:
        """Forget everything; the next frame is the origin of the map."""
        self.cell_map = self._new_map(self.config)
        self._matcher = Matcher(self.config)
        self._scanners = Scanners(self._matcher)
        self._before: Odometry | None = None
        self._T_map_robot: Float = np.zeros(3)
        self._pose_covariance = PoseCovariance(self.config)
        self._odometry_noise = OdometryNoise.of_beams(self.config)
        self._standing = Standing(self.config.standing)
        self._believe(self._matcher.match)
        new_map = self._map_anew if self.map_moves else None
        new_submap = functools.partial(self._new_submap, self.config)
        self._loops = Loops(self.config, self._matcher, new_submap, new_map)
        self._trusted = True  # the pose of the frame before
        self._path = PosePath()

    @staticmethod
    @abc.abstractmethod
    def _new_map(config: Any) -> CellMap:
        """An empty map of the SLAM's own."""

    def _believe(self, match: Callable[[Observations, Prediction, CellMap], Match]) -> None:
        """``match`` matches a scan to the map, or to a copy of it."""
        self._belief = Belief(self._matcher, match, self._standing.agreement)

    def _map_anew(self) -> CellMap:
        """An empty map for what the present one has."""
        return self._new_map(self.config).begun_like(self.cell_map)

    @classmethod
    def _new_submap(cls, config: Any) -> CellMap:
        """An empty map for what the key frames of a loop saw."""
        return cls._new_map(config)

    def update(self, frame: Frame) -> Estimate:
        """One frame in seven steps: from odometry and scan to pose, covariance and map.

        After them, a bounded part of the search for loops. A correction that is ready moves map
        and pose before the next one; ``diagnostics`` say so: "correction" and "T_map_odom"
        (docs/loops.md).
        Not converged while frozen, lost, or blind: a scan without a single return.
        """
        if self._before is None and self._pose_covariance.loaded is None:
            return self._first(frame)
        self._path.check_order(frame.stamp_ns)
        self._correct()
        prediction = self._predict(frame)  # 1 odometry prior
        observations = observe(frame, prediction.twist, self.config)  # 2 de-skewed points, view
        observations = self._standing.weighted(
            frame.stamp_ns, prediction.T_map_robot, prediction.prior, observations
        )
        judged = self._judge(observations, prediction)  # 3 Eq. (13), and whether it is believed
        residuals = self._update_map(observations, judged)  # 4 residuals, then 5 Eq. (8)
        trust = self._update_uncertainty(observations, judged, residuals)  # 6 pose, odometry noise
        self._add_to_path(observations, judged)  # 7 key frames for loops
        match, state = judged.match, judged.state
        if state is State.TRACKING or not self._belief.certain:
            self._standing.add(frame.stamp_ns, match.T_map_robot, observations)
        estimate = self._report(frame, match, trust)
        self._search_loops()
        return estimate

    def _first(self, frame: Frame) -> Estimate:
        self._scanners.look(frame)
        twist = frame.odometry.twist
        moving = np.zeros(3) if twist is None else np.asarray(twist)
        observations = observe(frame, moving, self.config)
        rasterise(self.cell_map, observations, self._T_map_robot)
        T_map_laser = se2.compose(self._T_map_robot, observations.T_robot_laser)
        first_s = self.config.map.first_look_s
        self.cell_map.integrate(observations.view, T_map_laser, first_s, write=True)
        match = unmatched(np.zeros(3), matched=1.0, score=0.0)
        self._loops.add(match.T_map_robot, np.zeros(3), np.zeros((3, 3)), observations)
        self._standing.add(frame.stamp_ns, match.T_map_robot, observations)
        self._belief.first(observations)
        return self._report(frame, match)

    def _search_loops(self) -> None:
        """Not in a scan in which the robot was searched for, which takes its time."""
        if self._belief.busy == 1.0:
            return
        error = self._loops.map_error()
        if error is not None:
            self._pose_covariance.known(error)
        self._loops.work(1.0 - self._belief.busy)

    def _correct(self) -> None:
        """Move into the map that loops have corrected, if it is ready."""
        self._path.moved_by = np.zeros(3)
        if not (self._belief.certain and self._trusted):
            return
        correction = self._loops.correction(self._path.poses)
        if correction is None:
            return
        self.cell_map, T_new_old = correction.cell_map, correction.T_new_old
        self._T_map_robot = self._path.correct(correction.poses, T_new_old, self._T_map_robot)
        self._standing.moved(T_new_old)
        self._pose_covariance.turned(float(T_new_old[2]))

    def _predict(self, frame: Frame) -> Prediction:
        """By odometry; on the first frame with a loaded map, where the robot was before."""
        odometry, look = frame.odometry, self._scanners.look(frame)
        if self._before is not None:
            found = self._odometry_noise.predict(self._T_map_robot, self._before, odometry)
            return found if look is None else found.changed(own=look)
        assert self._pose_covariance.loaded is not None
        return Prediction(
            T_map_robot=self._T_map_robot,
            increment=np.zeros(3),
            covariance=self._pose_covariance.loaded,
            twist=np.zeros(3) if odometry.twist is None else np.asarray(odometry.twist),
            elapsed=self.config.map.resumed_look_s,
        )

    def _judge(self, observations: Observations, prediction: Prediction) -> Judged:
        """The pose, and what is to be made of it.

        The prior is wider where enough is in view to correct what odometry alone gave for the pose
        before. The first scan of one more scanner is taken where motion leads: what it sees may
        be in no map yet.
        """
        if self._scanners.new and self._trusted and self._belief.certain:
            led, state = unmatched(prediction.T_map_robot, matched=1.0, score=0.0), State.TRACKING
            return Judged(led, prediction, state, self.cell_map, writes=True, followed=False)
        relocalise = self.config.tracking.relocalise
        if observations.amount >= relocalise.least_weight:
            motion = prediction.T_map_robot - self._T_map_robot
            prediction = prediction.changed(carried=self._pose_covariance.odometry_part(motion))
        judged = self._belief.judge(self.cell_map, observations, prediction)
        self.cell_map = judged.cell_map
        if judged.state is State.RELOCATED:
            self._pose_covariance.relocated(coarse(relocalise))
        return judged

    def _update_map(self, observations: Observations, judged: Judged) -> Residuals | None:
        """Let the map see the frame, where the pose is believed.

        Returns what the observed surfaces said about it before, where the robot was tracked to it.
        Old surface is noted in doubt, too: the first match after it needs that of now.
        """
        match, elapsed = judged.match, judged.prediction.elapsed
        look, longest_s = judged.prediction.look, self.config.map.longest_look_s
        T_map_robot, step = match.T_map_robot, min(look, longest_s)
        tracked, residuals = judged.state is State.TRACKING, None
        if tracked or judged.followed:
            short_term, turn = self._matcher.reward.short_term, self._loops.n_frames
            times = step, self._pose_covariance.unseen_s
            residuals = residuals_of(
                self.cell_map, short_term, observations, T_map_robot, times, turn
            )
        old = np.zeros(6) if residuals is None else residuals.old
        self._standing.agreement.hold(old, elapsed)
        if judged.writes:
            self.cell_map.off_cm = math.ceil(min(100.0 * self._pose_covariance.off_m, MOST_OFF))
            rasterise(self.cell_map, observations, T_map_robot)
            T_map_laser = se2.compose(T_map_robot, observations.T_robot_laser)
            self.cell_map.integrate(observations.view, T_map_laser, step, write=True)
            if tracked and judged.followed:
                self._belief.learn(judged)
        return residuals if tracked else None

    def _update_uncertainty(
        self, observations: Observations, judged: Judged, residuals: Residuals | None
    ) -> float:
        """Returns how far the matched returns are trusted, in [0, 1]."""
        match, prediction = judged.match, judged.prediction
        agreement = self._standing.agreement
        lasting, now = agreement.left_behind(), agreement.covariance()
        if match.slipped:  # found by a search, among what does not fit there
            lasting = (1.0 - match.overlapped) * coarse(self.config.tracking.relocalise)
        self._pose_covariance.update(self._T_map_robot, prediction, match, residuals)
        matched = match.tau > 0.0 and not match.slipped
        if residuals is not None and matched:
            self._pose_covariance.held(agreement.shown, residuals.old_off_m2, prediction.elapsed)
        self._pose_covariance.dragged(lasting, now)
        if judged.followed and judged.state is not State.RELOCATED and not match.slipped:
            self._odometry_noise.note_slip(prediction, match)
        else:
            self._odometry_noise.forget_slip()
        if judged.state is State.TRACKING and matched:
            sigma_m, along_rad = observations.sensor_sigma_m, self._pose_covariance.along_rad
            self._odometry_noise.learn(prediction, match, sigma_m, along_rad)
        else:
            self._odometry_noise.nis = None
        return observations.mean_weight

    def _add_to_path(self, observations: Observations, judged: Judged) -> None:
        """For closing loops: motion as matched, or by odometry where an end of it is uncertain."""
        match, prediction, state = judged.match, judged.prediction, judged.state
        motion = se2.between(self._T_map_robot, match.T_map_robot)
        covariance = self._pose_covariance.newest_drift
        found = state is State.RELOCATED or match.slipped
        if found:  # carried away, or odometry was right: loops decide
            off = prediction.off(match.T_map_robot)
            covariance = prediction.covariance + coarse(self.config.tracking.relocalise)
            covariance = covariance + np.diag(off * off)
        elif state is not State.TRACKING and judged.followed:
            covariance = prediction.covariance  # matched to the scans before, if not to the map
        elif state is not State.TRACKING or not self._trusted:
            motion, covariance = prediction.increment, prediction.covariance
        self._trusted = found or state is State.TRACKING
        covariance = turned(covariance, -float(self._T_map_robot[2]))
        written = state is State.TRACKING or (found and judged.writes)
        elapsed, T_map_robot = prediction.elapsed, match.T_map_robot
        self._loops.add(
            T_map_robot, motion, covariance, observations, elapsed=elapsed, written=written,
            found=found,
        )  # fmt: skip

    def _report(self, frame: Frame, match: Match, trust: float = 1.0) -> Estimate:
        """Where motion led, with the covariance of all places where the robot may be."""
        sure, belief = self._pose_covariance, self._belief
        self._before, self._T_map_robot = frame.odometry, match.T_map_robot
        T_map_robot, state = match.T_map_robot, belief.state
        self._path.add(frame.stamp_ns, T_map_robot)
        covariance = sure.covariance + belief.spread_about(T_map_robot, self._loops.anywhere)
        return Estimate(
            stamp_ns=frame.stamp_ns,
            T_map_robot=T_map_robot,
            covariance=covariance,
            converged=state in (State.TRACKING, State.RELOCATED),
            diagnostics={
                "state": state.value,
                "matched": match.matched,
                "searched": match.searched,
                "evaluations": match.evaluations,
                "unobservable": sure.unobservable,
                "unobservable_rad": sure.along_rad,
                "nis": self._odometry_noise.nis,
                "trust": trust,
                "p_lost": belief.p_lost,
                "correction": self._path.moved_by.tolist(),
                "T_map_odom": self._path.T_map_odom.tolist(),
            },
        )

    def displace(self, by: Float) -> None:
        """For experiments: from now on the pose is believed to be off by ``by`` (3,), map frame.

        As after a slip that nobody noticed: covariance, map and all that was kept of earlier scans
        stay as they are.
        """
        self._T_map_robot = self._T_map_robot + by
        self._T_map_robot[2] = se2.wrap(float(self._T_map_robot[2]))

    def window(self, xmin: float, ymin: float, xmax: float, ymax: float) -> tuple[Float32, Float32]:
        """Dense short-term x and long-term y of the cells centred in the rectangle (map, m)."""
        return self.cell_map.window(xmin, ymin, xmax, ymax)

    def place(self, T_map_robot: Float, covariance: Float) -> None:
        """Take the next frame near this pose in the map, off by as much as ``covariance`` says.

        For a map that was loaded: odometry and clock begin anew.
        """
        self._T_map_robot, self._before = T_map_robot, None
        self._pose_covariance.resumed(covariance, covariance)
        self._loops.hold()

    @property
    def usual_match(self) -> float:
        """Median share of a scan that matched the map."""
        return self._matcher.usual.match

    def matched(self, observations: Observations, T_map_robot: Float, covariance: Float) -> Match:
        """The match to the map as it is, from this pose on, off by as much as that."""
        return self._matcher.matched(self.cell_map, observations, T_map_robot, covariance)

    def save(self, path: Path, extra: Mapping[str, NDArray[Any]] | None = None) -> None:
        """Write map, knobs and pose to a file for ``load``; raises ``OutputError``.

        ``extra`` arrays lie beside them, for ``map_file.read_extra``.
        """
        state = memory.State(
            kind=type(self).__name__,
            T_map_robot=self._T_map_robot,
            covariance=self._pose_covariance.covariance,
            usual=tuple(self._matcher.usual.matches),
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
        cls._get_ready()
        slam.reset()
        try:
            memory.fill(slam.cell_map, arrays)
        except InvalidValueError as error:  # blocks farther apart than a map can be
            raise LogFormatError(path, str(error)) from error
        slam._T_map_robot = state.T_map_robot
        loaded = state.covariance + coarse(config.tracking.relocalise)
        slam._pose_covariance.resumed(state.covariance, loaded)
        slam._loops.hold()
        slam._matcher.usual.know(state.usual)
        return slam

    def hold_map(self) -> None:
        """The map is a frame of reference from now on: closed loops do not move it."""
        self._loops.hold()

    def poses_in_map(self) -> Float:
        """(n, 3) of all frames so far in the map as it is now: moved with it by each correction."""
        return self._path.poses()

    def trajectory(self) -> Trajectory:
        """The poses moved with the loops found so far where they tear the map, else as online."""
        return self._path.trajectory(self._loops.corrected(self._path.poses()))

# SPDX-License-Identifier: Apache-2.0
"""What a map explains of the scans of a real log, at right poses and at wrong ones.

The SLAM drives along the log, and no doubt begins. Of some scans it is kept what is explained

- at the right pose, and at wrong places that a search of the whole map finds: "place";
- of what the scans before matched, and the same of a scan seen far away, as if the robot had been
  carried here: "goes on".
"""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scripts.experiments import along_log
from scripts.experiments.judging import Log, truth_of
from scripts.experiments.relations import seconds
from slam import se2
from slam.files import write_text
from slam.frames import EPOCH, Float, Frame
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction
from slam.shunting import ShuntingSlam
from slam.tracker.belief.places import coarse
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.coarse_map import CoarseMap
from slam.tracker.matching.matcher import Match
from slam.tracker.matching.whole_search import WholeSearch

WRONG_M, WRONG_RAD = 1.0, 0.5  # a place is wrong that is off by either
CARRIED_M, CARRIED_RAD = 3.0, 0.5 * math.pi  # where another scan was seen, off by either
STEP_M, STEP_RAD = 0.1, 0.1  # a pose is right after a step that the reference confirms to both
FIRST_SHARE = 0.1  # of a log, before a scan is asked
UNBOUNDED = 1e6  # times the time of a scan, for a search
ENOUGH = 100  # scans before the robot is carried: else those after it are taken
LEAST = 1e-3  # share: numerical guard
PLACE, GOES_ON = "place", "goes on"
Sample = tuple[str, float, bool]
"""Kind, share explained, whether it is right."""


class Asked(ShuntingSlam):
    """A SLAM that is asked at some of its scans.

    ask  called with a scan before it is taken in, and its match, where it is a function
    """

    ask: Callable[[Observations, Prediction, Match], None] | None = None

    def _believe(self, match: Callable[[Observations, Prediction, CellMap], Match]) -> None:
        def noted(observations: Observations, prediction: Prediction, cell_map: CellMap) -> Match:
            found = match(observations, prediction, cell_map)
            if self.ask is not None:
                self.ask(observations, prediction, found)
            return found

        super()._believe(noted)


class Drive:
    """Along one log; ``samples`` so far."""

    def __init__(self, stamps: Sequence[int]) -> None:
        """Asked at these stamps, ns."""
        self.samples: list[Sample] = []
        self._slam, self._stamps = Asked({"carried_per_h": 0.0}), set(stamps)
        self._numbers = self._slam.config.tracking.relocalise
        self._rng = np.random.default_rng(len(stamps))
        self._poses: list[Float] = []  # in the map, and of the reference
        self._truths: list[Float] = []
        self._seen: list[tuple[Float, Observations]] = []  # by the reference
        self._new: list[Sample] = []
        self._led = np.zeros(3)  # the pose before by the reference, or by odometry

    def take(self, frame: Frame) -> None:
        """The next scan of the log."""
        led = frame.odometry.T_odom_robot if frame.truth is None else frame.truth
        self._slam.ask = None
        if frame.stamp_ns in self._stamps and self._poses:
            self._slam.ask = lambda *of: self._ask(frame, *of)
        pose = self._slam.update(frame.without_truth()).T_map_robot
        if self._poses:
            step, wanted = se2.between(self._poses[-1], pose), se2.between(self._led, led)
            self.samples += [] if far(step, wanted, STEP_M, STEP_RAD) else self._new
        self._new, self._led = [], led
        self._poses.append(pose)
        self._truths.append(pose if frame.truth is None else frame.truth)

    def _ask(
        self, frame: Frame, observations: Observations, prediction: Prediction, match: Match
    ) -> None:
        slam, numbers, matcher = self._slam, self._numbers, self._slam._matcher
        if observations.amount < numbers.least_weight:
            return
        self._new.append((GOES_ON, matcher.usual.share(match, observations), True))
        there = match.T_map_robot
        truth = self._reference(there) if frame.truth is None else frame.truth
        others = [seen for at, seen in self._seen if far(at, truth, CARRIED_M, CARRIED_RAD)]
        if others:
            other = others[self._rng.integers(len(others))]
            at, prior = prediction.T_map_robot, prediction.prior
            other = slam._standing.weighted(frame.stamp_ns, at, prior, other)
            carried = matcher.match(other, prediction, slam.cell_map)
            self._new.append((GOES_ON, matcher.usual.share(carried, other), False))
        everyone = observations.weighted(None)
        self._seen.append((truth, everyone))
        self._new.append((PLACE, self._explained(everyone, there)[1], True))
        for answer in searched(slam, everyone):
            place, share = self._explained(everyone, answer)
            is_far = far(place, there, WRONG_M, WRONG_RAD)
            if is_far and far(self._reference(place), truth, WRONG_M, WRONG_RAD):
                self._new.append((PLACE, share, False))

    def _explained(self, everyone: Observations, pose: Float) -> tuple[Float, float]:
        """Where a climb from there ends, and the share of the usual match that it explains."""
        match = self._slam.matched(everyone, pose, coarse(self._numbers))
        return match.T_map_robot, match.overlapped / max(self._slam.usual_match, LEAST)

    def _reference(self, place: Float) -> Float:
        """A place in the map by the reference: the map around it was drawn from a pose nearby."""
        off = np.array(self._poses)[:, :2] - place[:2]
        k = int(np.argmin((off * off).sum(axis=1)))
        return se2.compose(self._truths[k], se2.between(self._poses[k], place))


def far(one: Float, other: Float, m: float, rad: float) -> bool:
    """Whether poses are apart by more than either."""
    x, y, turn = (one - other).tolist()
    return math.hypot(x, y) > m or abs(se2.wrap(turn)) > rad


def searched(slam: ShuntingSlam, everyone: Observations) -> list[Float]:
    """All answers of a search of the whole map."""
    config, matcher = slam.config, slam._matcher
    whole = CoarseMap(slam.cell_map, matcher.reward.short_term)
    most = config.tracking.relocalise.most
    search = WholeSearch(whole, everyone.points_robot, most, config.matching.whole)
    found: list[Float] = []
    while not search.done:
        found += search.advance(Budget(config.matching.budget, UNBOUNDED))
    return found


def frames_of(log: Log, file: Path, data: Path) -> list[Frame]:
    """The scans of a log from before or after the robot was carried, with a reference if any."""
    words = [str(file), "", *(["--scan", *log.scan] if log.scan else [])]
    words += ["--laser", json.dumps(log.laser)] if log.laser else []
    stream = along_log.frames_of(along_log.options().parse_args(words))
    frames = [frame for frame in stream if frame.scan is not None]
    if log.truth is not None:
        epoch_ns = int(stream.metadata.extra.get(EPOCH, 0))
        stamps_ns = np.array([frame.stamp_ns for frame in frames]) + epoch_ns
        truths = truth_of(data / log.truth, seconds(stamps_ns))
        pairs = zip(frames, truths, strict=True)
        frames = [replace(frame, truth=at) for frame, at in pairs if np.isfinite(at).all()]
    if log.carried is not None:
        first = log.carried >= ENOUGH
        frames = frames[: log.carried] if first else frames[log.carried :]
    known = [frame for frame in frames if frame.truth is not None]
    return known or frames


def sampled(path: Path, *, log: dict[str, Any], file: str, data: str, scans: int) -> None:
    """A job: the samples of a log, as JSON."""
    frames = frames_of(Log(**log), Path(file), Path(data))
    first, every = int(FIRST_SHARE * len(frames)), max(1, len(frames) // scans)
    drive = Drive([frame.stamp_ns for frame in frames[first::every]])
    for frame in frames:
        drive.take(frame)
    write_text(path, json.dumps(drive.samples))

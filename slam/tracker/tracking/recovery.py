# SPDX-License-Identifier: Apache-2.0
"""From the first scan that the map denies until the robot is found, or the map is outdated there.

Scans are matched to each other meanwhile (``wake``), and the map is searched for the robot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from slam import se2
from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.matcher import Match, Matcher, unmatched
from slam.tracker.tracking.quality import TrackingQuality
from slam.tracker.tracking.relocalise import Relocalisation
from slam.tracker.tracking.verdict import Verdict
from slam.tracker.tracking.wake import Wake


class Recovered(NamedTuple):
    """What came of one scan of a lost robot.

    state     "relocated", or still "lost"
    cell_map  the one to go on in
    found     whether the search found the robot
    """

    match: Match
    state: str
    cell_map: CellMap
    found: bool = False


class Recovery:
    """Of one robot; changes ``quality`` and ``verdict`` as it goes.

    wake       while frozen or lost: the map of what was seen since
    search     while lost
    suspected  the same search while frozen
    """

    def __init__(
        self,
        config: TrackerConfig,
        matcher: Matcher,
        match: Callable[[Observations, Prediction, CellMap], Match],
        quality: TrackingQuality,
        verdict: Verdict,
    ) -> None:
        """``match`` matches a scan to a map as the SLAM does."""
        self._numbers = config.tracking
        self._matcher, self._match = matcher, match
        self._quality, self._verdict = quality, verdict
        self.wake: Wake | None = None
        self.search: Relocalisation | None = None
        self.suspected: Relocalisation | None = None

    @property
    def active(self) -> bool:
        """Whether the robot is lost, or the map denied the scan before."""
        return self.wake is not None or self.search is not None

    @property
    def followed(self) -> bool:
        """Whether the latest scan was matched to those since the first that was denied."""
        return self.wake is not None and self.wake.followed

    def skip(self) -> None:
        """A scan that nothing is made of."""
        if self.wake is not None:
            self.wake.followed = False

    def end(self) -> None:
        """The map fits again."""
        self.suspected = self.wake = None

    def deny(
        self,
        cell_map: CellMap,
        T_map_robot: Float,
        observations: Observations,
        prediction: Prediction,
        match: Match,
    ) -> Match:
        """The map denies the frame: from now on scans are matched to each other, too.

        ``T_map_robot``: of the frame before, here and below.
        """
        if self.wake is None:
            self.wake = Wake(cell_map)
            self.wake.carried = match.matched < self._quality.least_continuous()
            self.wake.add(observations, match.T_map_robot, prediction.elapsed)
            return match
        moved = self._go_on(T_map_robot, observations, prediction)
        return replace(match, T_map_robot=moved.T_map_robot)

    def suspect(
        self, cell_map: CellMap, observations: Observations, prediction: Prediction
    ) -> None:
        """The frame is denied: begin to search the map, and from some such frames on be lost."""
        quality = self._quality
        if not quality.suspicious:
            return
        suspected = self.suspected or Relocalisation(cell_map, self._matcher)
        suspected.look(observations, prediction)
        lost = quality.scans >= quality.config.lost_after
        self.search, self.suspected = (suspected, None) if lost else (None, suspected)

    def recover(
        self,
        search: Relocalisation,
        cell_map: CellMap,
        T_map_robot: Float,
        observations: Observations,
        prediction: Prediction,
    ) -> Recovered:
        """Dead reckoning, until one hypothesis of the ``search`` alone explains what is seen."""
        prediction = self._go_on(T_map_robot, observations, prediction)
        observations = observations.with_votes(None)  # they are of another place
        predicted = prediction.T_map_robot
        precision = inverted(prediction.prior)
        here = self._matcher.climb(cell_map, observations, predicted, predicted, precision)
        wake, usual = self.wake, self._quality.usual_whole()
        carried = wake is None or wake.carried
        match = search.step(observations, prediction, here, usual, carried=carried)
        elsewhere = search.elsewhere(predicted)
        self._verdict.take(search.here / usual, elsewhere / usual)
        if match is not None:
            self._stop()
            self._verdict.trust()
            self._quality.relocated(search.accepted)
            cell_map = wake.map if wake is not None and search.went_on else cell_map
            return Recovered(match, "relocated", cell_map, found=True)
        match = unmatched(predicted, matched=here.matched, score=here.score)
        unknown = elsewhere < self._numbers.relocalise.enough_last * usual
        if wake is not None and unknown and not carried and self._agrees(wake):
            self._stop()
            return Recovered(match, "relocated", wake.map)  # the map is outdated here
        if search.elapsed_s > self._numbers.quality.give_up_s:
            # elsewhere: go on from here, as on the first frame
            self._stop()
            self._quality.give_up()
            return Recovered(match, "lost", cell_map if wake is None else wake.map)
        return Recovered(match, "lost", cell_map)

    def _agrees(self, wake: Wake) -> bool:
        return self._quality.goes_on(wake.agreed, wake.agreed_s)

    def _stop(self) -> None:
        """Be lost no more."""
        self.search = self.wake = None
        self._quality.count(False)

    def _go_on(
        self, T_map_robot: Float, observations: Observations, prediction: Prediction
    ) -> Prediction:
        """The pose on the wake's map, where the scan agrees with it; else by odometry."""
        wake = self.wake
        if wake is None:
            return prediction
        wake.followed = False
        enough = observations.weight >= self._numbers.relocalise.least_weight
        match = self._match(observations, prediction, wake.map) if enough else None
        if match is not None and match.matched >= self._quality.least_continuous():
            increment = se2.between(T_map_robot, match.T_map_robot)
            prediction = replace(prediction, T_map_robot=match.T_map_robot, increment=increment)
            wake.followed = True
        wake.carried |= match is not None and match.matched < self._quality.least_continuous()
        agreed = match is not None and not self._quality.arises(match.matched)
        wake.count(agreed, prediction.elapsed)
        wake.add(observations, prediction.T_map_robot, prediction.elapsed)
        return prediction

# SPDX-License-Identifier: Apache-2.0
"""Where an environment's robot believes it is: by a SLAM, by its wheels, or by the truth."""

import numpy as np

from slam import se2
from slam.answers import judged
from slam.errors import InvalidValueError, SlamFailedError
from slam.frames import Float, Frame
from slam.replay import Track
from slam.system import SlamSystem, create, refuse_at_the_end

FAR_M = 1e4  # poses are told up to here


class PoseSource:
    """``source``: "truth", a SLAM's name or ``module:Class`` (each source has its own), or one.

    Attributes: ``pose`` (3,) believed, m, m, rad in the frame of the start, and whether the source
    has ``trusted`` it. Raises ``InvalidValueError`` or ``UnknownNameError`` for anything else, and
    for a SLAM that runs at the end only.
    """

    def __init__(self, source: str | SlamSystem) -> None:
        self._name = source if isinstance(source, str) else type(source).__name__
        self._system: SlamSystem | None = None
        if isinstance(source, str):
            self._system = None if source == "truth" else create(source)
        elif isinstance(source, SlamSystem) and not isinstance(source, type):
            self._system = source
        else:
            raise InvalidValueError(
                "pose_source must be 'truth', the name of a SLAM, module:Class or a SlamSystem, "
                f"got {source!r}"
            )
        refuse_at_the_end(self._system, self._name, "an environment")
        self._track: Track | None = None
        self._start: Float = np.zeros(3)
        self.pose: Float = np.zeros(3)
        self.trusted = True

    def reset(self, T_world_start: Float) -> None:
        """A new episode from there; the SLAM forgets everything."""
        self._start = T_world_start
        if self._system is not None:
            self._track = Track(name=self._name, system=self._system)
            try:
                with judged(self._system.reset):
                    self._system.reset()
            except SlamFailedError as error:
                raise error.at(f"SLAM '{self._name}', reset()") from error

    def take(self, frame: Frame) -> None:
        """One more scan; ``SlamFailedError`` when the SLAM fails."""
        if self._track is None:
            assert frame.truth is not None  # the simulator always knows
            pose, self.trusted = se2.between(self._start, frame.truth), True
        else:
            estimate = self._track.take(frame.without_truth())
            pose, self.trusted = estimate.T_map_robot, estimate.converged
        x, y, theta = pose.tolist()
        x, y = min(max(x, -FAR_M), FAR_M), min(max(y, -FAR_M), FAR_M)
        self.pose = np.array([x, y, se2.wrap(theta)])

    def towards(self, goal: tuple[float, float]) -> Float:
        """(2,) m of a goal in the world, as seen from the believed pose."""
        of_start = se2.transform(se2.inverse(self._start), np.array(goal))
        return se2.transform(se2.inverse(self.pose), of_start)

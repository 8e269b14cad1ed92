# SPDX-License-Identifier: Apache-2.0
"""Frames with what a recording also holds: where everything was at the stamp."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim.actors.rearranging import Rearrangement
from sim.driving.drive import TourConfig
from sim.driving.pilot import Pilot
from sim.simulation import Simulation, n_frames
from slam.frames import Float, Frame
from slam.frontend.odometry_steps import MotionSum


@dataclass(frozen=True, kw_only=True, eq=False)
class Moment:
    """A frame, and every mover of the scene at the start of its scan.

    poses   (n, 3) m, m, rad in the world, as ``World.mover_poses``
    moving  (n,) whether it moves just then
    rearranged  what was changed out of sight just before the scan
    others  the frames of the scanners beside the first, at the same time
    """

    frame: Frame
    poses: Float
    moving: NDArray[np.bool_]
    rearranged: tuple[Rearrangement, ...] = ()
    others: tuple[Frame, ...] = ()

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Of all scanners."""
        return (self.frame, *self.others)


def toured(
    simulation: Simulation,
    seconds: float,
    config: TourConfig | None = None,
    *,
    keep_out: Float | None = None,
) -> Iterator[Moment]:
    """``sim.simulation.tour``, moment by moment; ``keep_out`` as for ``Pilot``."""
    world = simulation.world
    pilot = Pilot(world, config, keep_out=keep_out)
    for _ in range(n_frames(seconds, simulation.scan_period_s)):
        world.set_command(*pilot.command(simulation.scan_period_s))
        yield observed(simulation)


def observed(simulation: Simulation) -> Moment:
    """Let one scan's worth of time pass under the present command; the moment it gives."""
    world = simulation.world
    poses, moving = world.mover_poses(), world.movers_moving()
    frame = simulation.observe()
    for event in simulation.rearranged:
        row = world.mover_names.index(event.name)
        poses[row], moving[row] = event.after, False
    rearranged = tuple(simulation.rearranged)
    return Moment(
        frame=frame, poses=poses, moving=moving, rearranged=rearranged,
        others=simulation.frames_of_others,
    )  # fmt: skip


def thinned(moments: Iterable[Moment], every: int) -> Iterator[Moment]:
    """The first of each ``every``, its odometry with the covariance of all motion since the last.

    None, where the odometry stated none: zero would say that it is exact.
    """
    motion = MotionSum()
    for k, moment in enumerate(moments):
        motion.add(moment.frame.odometry)
        if k % every == 0:
            yield replace(moment, frame=motion.passed_on(moment.frame))

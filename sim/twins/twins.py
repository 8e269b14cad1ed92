# SPDX-License-Identifier: Apache-2.0
"""The same drive three times: through a room that moves, one that has been moved, one at rest.

How much of an error is due to motion? To answer that, everything else must be equal: the robot's
path, its odometry, the noise of every beam. So the dynamic version is driven first; then the
recorded path is replayed kinematically, the robot carried along it, in two twins of the room:

- **static**: everything as laid out at the start, for the whole run;
- **semi-static**: things stand still whenever they can be seen, and are found elsewhere later. A
  mover takes the place it rests at in the dynamic version once it has been out of sight for
  ``sim.twins.room.UNSEEN_S`` and that place is out of sight too. Same displacements, no motion.

The driver of the dynamic version also keeps clear of the places at the start, and a path that
crosses a mover of the static twin is rejected for one with another tour. In the semi-static twin
nothing is put where the path crosses later. Slip is off: odometry follows from the path, so it is
the same to the bit in all three, as are the numbers drawn for the beams' noise.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from scenes.crowd import mix
from sim.core.dynamism import Dynamism
from sim.core.seeds import Seeds
from sim.driving.drive import TourConfig
from sim.moments import Moment, toured
from sim.sensors.lidar.device import LaserScanner
from sim.sensors.odometry.encoders import WheelOdometry
from sim.simulation import Simulation
from sim.twins.room import Drive, TwinRoom
from sim.world.sweep import ScanTiming
from sim.world.world import World
from slam._jit import njit
from slam.errors import InvalidValueError
from slam.frames import Float, Frame, Odometry, Stream, StreamMetadata

TWINS = ("dynamic", "semi_static", "static")


@njit
def rolled(path: Float, track: float) -> Float:
    """(n, 3) m rolled by left and right wheel along poses (n, 3) without slip; 0 sideways."""
    out = np.zeros((path.shape[0], 3))
    for k in range(1, path.shape[0]):
        dx, dy = path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1]
        turn = path[k, 2] - path[k - 1, 2]
        middle = path[k - 1, 2] + 0.5 * turn
        forward = dx * math.cos(middle) + dy * math.sin(middle)
        out[k, 0] = out[k - 1, 0] + forward - 0.5 * track * turn
        out[k, 1] = out[k - 1, 1] + forward + 0.5 * track * turn
    return out


class Twins:
    """A drive and its three versions, by the names in ``TWINS``: one path, odometry and noise.

    seconds   of driving                     tour  limits of the driver
    tries     tours tried until one keeps clear of everything in the static twin
    settings  as for ``Simulation``, without ``kidnap_every_s``, ``session``, ``events``
              and ``also_at``

    Where no crowd is given it is the scene's without escorts: at rest about the robot, they would
    stand in its way. The drive is remembered (1 to 2 KB a scan), frames are simulated again at each
    ``moments``.
    Raises ``InvalidValueError`` when every tour crosses a mover, naming those of the last one, and
    for these four, which a replayed path cannot have.
    """

    def __init__(
        self,
        scene: str = "office",
        *,
        seconds: float = 60.0,
        seed: int | Seeds = 0,
        dynamism: float | Dynamism = 0.5,
        tour: TourConfig | None = None,
        tries: int = 8,
        **settings: Any,
    ) -> None:
        for taken in ("kidnap_every_s", "session", "events", "also_at"):
            if settings.get(taken) is not None:
                raise InvalidValueError(f"Twins take no {taken}, got {settings[taken]!r}")
        seeds = seed if isinstance(seed, Seeds) else Seeds(seed)
        if "crowd" not in settings and isinstance(scene, str):
            axes = {name: settings.get(name) for name in ("moving_share", "motion", "change")}
            whole = mix(scene, Dynamism.of(dynamism, **axes).crowd)
            settings["crowd"] = str(replace(whole, escorts=0))
        self._labels = bool(settings.get("labels", False))
        crossed: list[str] = []
        for attempt in range(max(1, tries)):
            own = seeds
            if attempt > 0:
                own = Seeds(**{**seeds.record(), "driving": seeds.integer("driving") + attempt})
            self._again = partial(Simulation, scene, seed=own, dynamism=dynamism, **settings)
            self._tour = partial(_toured, seconds=seconds, config=tour)
            self.simulation = self._again()
            self._drive = _driven(self.simulation, self._tour(self.simulation))
            crossed = _twin(self.simulation, self._drive, labels=False).crosses()
            if not crossed:
                break
        else:
            raise InvalidValueError(
                f"none of {tries} tours keeps clear of everything at the start; "
                f"the last crosses {', '.join(crossed)}"
            )
        self._odometry = _odometry(self.simulation, self._drive)

    def moments(self, name: str) -> Iterator[Moment]:
        """One version of the drive."""
        if name == "dynamic":
            yield from self._dynamic()
        else:
            twin = _twin(self.simulation, self._drive, labels=self._labels)
            yield from twin.moments(self._odometry, moved=name == "semi_static")

    def _dynamic(self) -> Iterator[Moment]:
        moments = self._tour(self._again())
        for moment, odometry in zip(moments, self._odometry, strict=True):
            yield replace(moment, frame=replace(moment.frame, odometry=odometry))


def twins(scene: str = "office", **settings: Any) -> dict[str, Stream]:
    """Three streams by name, held in memory; ``settings`` as for ``Twins``."""
    made = Twins(scene, **settings)
    metadata = made.simulation.metadata()
    return {
        name: _stream(metadata, name, [moment.frame for moment in made.moments(name)])
        for name in TWINS
    }


def _toured(
    simulation: Simulation, *, seconds: float, config: TourConfig | None
) -> Iterator[Moment]:
    """A tour that also keeps clear of the places at the start."""
    return toured(simulation, seconds, config, keep_out=simulation.world.mover_poses())


def _driven(simulation: Simulation, moments: Iterator[Moment]) -> Drive:
    stamps_ns, truths, path, starts, qpos, rests = [], [], [], [], [], []
    before = simulation.world.data.qpos.copy()
    for moment in moments:
        if moment.frame.truth is not None:
            truths.append(moment.frame.truth)
        stamps_ns.append(moment.frame.stamp_ns)
        qpos.append(before)
        rests.append(~moment.moving)
        path.append(simulation.path.copy())
        starts.append(simulation.laser.window.before)
        before = simulation.world.data.qpos.copy()
    return Drive(
        stamps_ns=stamps_ns,
        truths=truths,
        path=path,
        before=starts,
        qpos=np.array(qpos),
        rests=np.array(rests),
    )


def _twin(simulation: Simulation, drive: Drive, *, labels: bool) -> TwinRoom:
    """The same room, at rest, with a scanner that draws the same noise."""
    seeds, scene = simulation.world.seeds, simulation.world.scene
    world = World(scene, seed=seeds, dynamism=0.0, drive=simulation.world.drive_config)
    laser = LaserScanner(world.model, simulation.laser.config, seeds.generator("lidar"))
    return TwinRoom(world, laser, drive, labels=labels)


def _odometry(simulation: Simulation, drive: Drive) -> list[Odometry]:
    """What the encoders say of the path if no wheel ever slips."""
    track = simulation.world.drive_config.track
    encoders = WheelOdometry(
        simulation.odometry_preset, simulation.world.seeds.generator("odometry"), track=track
    )
    rows = [path[k + 1 :] for path, k in zip(drive.path, drive.before, strict=True)]
    whole = np.concatenate([drive.path[0][:1], *rows])
    travel, readings = rolled(np.ascontiguousarray(whole), track), []
    laser, at = LaserScanner(simulation.world.model, simulation.laser.config), 0
    for stamp_ns, path, before in zip(drive.stamps_ns, drive.path, drive.before, strict=True):
        timing = ScanTiming.of(laser)
        own = travel[at - before : at - before + len(path)]
        readings.append(timing.odometry(encoders, own, stamp_ns, False))
        at += len(path) - 1 - before
        laser.skip()
    return readings


def _stream(metadata: StreamMetadata, name: str, frames: list[Frame]) -> Stream:
    labelled = replace(metadata, extra={**metadata.extra, "twin": name})
    return Stream(metadata=labelled, frames=lambda: iter(frames), length=len(frames))

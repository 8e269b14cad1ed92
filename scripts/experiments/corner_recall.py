# SPDX-License-Identifier: Apache-2.0
"""How many true corners the feature extractor finds, and how well: ``python -m
scripts.experiments.corner_recall``.

Three kinds of thing that can be located in two directions are known from the scenes: corners of
rooms, chair columns (legs and posts that cut the scanner's plane), door jambs. One counts as to be
found in a scan when the beams at it end there (nothing hides it), it is within reach and not at the
rim of the field of view; a corner of a room also needs its walls, 0.2 m of each. Nothing moves but
the robot. Two more lines count what is found: the features that lie at one of these things (beside
them there is other furniture in an office), and those that are found again a second later where
beams still end there, as the edge of a shadow, which moves with the robot, is not.
"""

from __future__ import annotations

import math
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field

import mujoco
import numpy as np

from scripts.experiments.shared import Column, Row
from scripts.experiments.study import Study
from sim.driving.pilot import Pilot
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.simulation import Simulation, n_frames
from slam import se2
from slam.frames import Float, Scan
from slam.frontend.corners import corners

KINDS = ("room corners", "chair columns", "door jambs")
KNOWN, AGAIN = "at one of these", "found again"
REACH_M = 6.0
GATE_M = 0.15  # a feature within this of the truth is it
AT_IT_M = 0.08  # a beam that ends this near to it was stopped by it
RIM_RAD = 0.15
WALL_M = 0.2  # of the walls at each side of a room's corner must be free
EVERY = 8
LATER = 5  # times EVERY scans are a second
THIN_M = 0.06


@dataclass(eq=False)
class Tally:
    """``seen`` chances to find one, ``errors`` (m) of those found."""

    seen: int = 0
    errors: list[float] = field(default_factory=list)

    def count(self, point: Float, found: Float) -> None:
        """One chance to have ``point`` among ``found`` (n, 2)."""
        self.seen += 1
        if len(found):
            away = math.sqrt(float(((found - point) ** 2).sum(axis=1).min()))
            if away < GATE_M:
                self.errors.append(away)


def truths(simulation: Simulation) -> dict[str, Float]:
    """(n, 2) m in the world frame of each kind, now."""
    world = simulation.world
    rooms = world.scene.rooms.values()
    corners_of_rooms = [(x, y) for x0, y0, x1, y1 in rooms for x in (x0, x1) for y in (y0, y1)]
    columns: list[tuple[float, float]] = []
    jambs: list[Float] = []
    model, data, height = world.model, world.data, world.scene.scan_height_m
    for geom in range(model.ngeom):
        body = model.body(int(model.geom_bodyid[geom])).name
        if body.startswith("chair") and model.geom_group[geom] < 3:
            columns += _cut(model, data, geom, height)
        elif body.startswith("door_frame") and model.geom_size[geom][2] > 0.1:
            turn = data.geom_xmat[geom].reshape(3, 3)
            along = turn[:2, 1] * model.geom_size[geom][1]
            jambs += [data.geom_xpos[geom][:2] + along, data.geom_xpos[geom][:2] - along]
    found = (corners_of_rooms, columns, jambs)
    return {k: np.array(v).reshape(-1, 2) for k, v in zip(KINDS, found, strict=True)}


def _cut(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, height: float
) -> Iterator[tuple[float, float]]:
    """Where the axis of a thin upright cylinder or capsule meets the scanner's plane."""
    kinds = {int(mujoco.mjtGeom.mjGEOM_CYLINDER), int(mujoco.mjtGeom.mjGEOM_CAPSULE)}
    radius, half = model.geom_size[geom][:2]
    axis = data.geom_xmat[geom].reshape(3, 3)[:, 2]
    if int(model.geom_type[geom]) not in kinds or radius > THIN_M or abs(axis[2]) < 0.5:
        return
    along = (height - data.geom_xpos[geom][2]) / axis[2]
    if abs(along) < half:
        x, y = data.geom_xpos[geom][:2] + along * axis[:2]
        yield float(x), float(y)


def visible(points_robot: Float, scan: Scan, around_m: float = 0.0) -> Float:
    """The points (n, 2), robot frame, at which a beam ends and before which, ``around_m`` to each
    side, nothing stands."""
    spec = scan.spec
    points = se2.transform(se2.inverse(spec.T_robot_laser), points_robot)
    distance = np.hypot(points[:, 0], points[:, 1])
    bearing = np.arctan2(points[:, 1], points[:, 0])
    beam = np.round((bearing - spec.angle_min) / spec.angle_increment).astype(int)
    rim = math.ceil(RIM_RAD / spec.angle_increment)
    inside = (beam >= rim) & (beam < spec.n_beams - rim) & (distance < REACH_M)
    near = np.clip(beam[:, None] + np.array([-1, 0, 1]), 0, spec.n_beams - 1)
    ends = np.abs(scan.ranges[near] - distance[:, None]) < AT_IT_M
    turn = np.abs(spec.angles[None, :] - bearing[:, None])
    aside = turn < np.arctan2(around_m, distance)[:, None]
    before = scan.ranges[None, :] < (distance - around_m - AT_IT_M)[:, None]
    kept: Float = points_robot[inside & ends.any(axis=1) & ~(aside & before).any(axis=1)]
    return kept


def run(case: Row) -> Row:
    """One tour of a scene: chances to find a thing of each kind, and errors, m, of those found."""
    laser = Lms221Config(resolution_deg=case["degrees"])
    simulation = Simulation(case["scene"], seed=case["seed"], dynamism=0.0, laser=laser)
    pilot, out = Pilot(simulation.world, None), {kind: Tally() for kind in (*KINDS, KNOWN, AGAIN)}
    world = truths(simulation)
    known = np.concatenate(list(world.values()))
    earlier: deque[Float] = deque(maxlen=LATER)
    for k in range(n_frames(case["seconds"], simulation.scan_period_s)):
        simulation.world.set_command(*pilot.command(simulation.scan_period_s))
        frame = simulation.observe()
        if k % EVERY or frame.scan is None or frame.truth is None:
            continue
        found = corners(frame.scan, twist=frame.odometry.twist).points_robot
        T_robot_world = se2.inverse(frame.truth)
        for kind, points in world.items():
            around_m = WALL_M if kind == KINDS[0] else 0.0
            for point in visible(se2.transform(T_robot_world, points), frame.scan, around_m):
                out[kind].count(point, found)
        for point in found:
            out[KNOWN].count(point, se2.transform(T_robot_world, known))
        if len(earlier) == LATER:
            for point in visible(se2.transform(T_robot_world, earlier[0]), frame.scan):
                out[AGAIN].count(point, found)
        earlier.append(se2.transform(frame.truth, found))
    return {kind: asdict(tally) for kind, tally in out.items()}


def found(kind: str) -> Column:
    """A column: chances, the share that was found, and how far off it was."""

    def tell(rows: Sequence[Row]) -> str:
        seen = sum(row[kind]["seen"] for row in rows)
        e = 1e3 * np.array([error for row in rows for error in row[kind]["errors"]])
        if not len(e):
            return f"0 of {seen}"
        middle, high = np.percentile(e, [50.0, 90.0])
        return f"{len(e) / seen:.2f} of {seen}, {middle:.1f} mm ({high:.1f})"

    return tell


STUDY = Study(
    name="corner_recall",
    axes={"scene": ("arena", "office"), "degrees": (0.5, 1.0)},
    run=run, lines=("scene", "degrees"),
    columns={kind: found(kind) for kind in (*KINDS, KNOWN, AGAIN)},
    told=f"Within {REACH_M:g} m; median and 90 % of the errors of those found.",
    defaults={"seeds": 3, "first_seed": 0, "seconds": 30.0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())

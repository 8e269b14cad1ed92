# SPDX-License-Identifier: Apache-2.0
"""Other robots than the scenes' own: footprint, drive and the scanner's place, from a small TOML.

A robot is a name of ``sim/robots`` or the tables of such a file (``docs/robots.md``).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import mujoco
import numpy as np
from msgspec import Meta

from scenes import SCAN_HEIGHT
from scenes.scene import Scene, at_scan_height
from sim.actors.robot import DriveConfig
from slam.bounded import toml_of
from slam.errors import InvalidValueError, LogFormatError, UnknownNameError
from slam.frames import Float
from slam.shaped import Table, Word, shaped

FOLDER = Path(__file__).parents[1] / "robots"
MOST_BYTES = 1 << 14
MOST_BESIDE = 7  # scanners beside the first
MASS_KG = 22.0  # of the scenes' robot, to which its tyres' stiffness and grip belong
Inertia = Annotated[float, Meta(ge=1e-4, le=500.0)]
Length = Annotated[float, Meta(ge=0.05, le=2.0)]
Offset = Annotated[float, Meta(ge=-1.0, le=1.0)]


class Footprint(Table, frozen=True):
    """A circle has ``radius_m``, a box the other two; 0: not said."""

    shape: Literal["circle", "box"]
    radius_m: Annotated[float, Meta(ge=0.05, le=1.0)] = 0.0
    length_m: Length = 0.0
    width_m: Length = 0.0
    ahead_m: Offset = 0.0


class Wheels(Table, frozen=True):
    """Its drive; a car alone has ``turn_radius_m``."""

    kind: Literal["differential", "car", "omnidirectional"]
    track_m: Annotated[float, Meta(ge=0.02, le=2.0)]
    v_max_mps: Annotated[float, Meta(ge=0.05, le=5.0)]
    omega_max_radps: Annotated[float, Meta(ge=0.05, le=10.0)]
    turn_radius_m: Annotated[float, Meta(ge=0.05, le=10.0)] = 0.0
    accel_mps2: Annotated[float, Meta(ge=0.05, le=20.0)] = 1.0
    alpha_radps2: Annotated[float, Meta(ge=0.05, le=50.0)] = 3.0


class Place(Table, frozen=True):
    """Of a scanner on its robot."""

    x_m: Offset = 0.0
    y_m: Offset = 0.0
    yaw_deg: Annotated[float, Meta(ge=-180.0, le=180.0)] = 0.0


def places_of(rows: Sequence[Mapping[str, Any]]) -> list[Float]:
    """``T_robot_laser`` of scanners beside a robot's first, from their places' tables.

    Raises ``InvalidValueError`` for what is no place, none, or more than ``MOST_BESIDE``.
    """
    if not isinstance(rows, list | tuple) or not 1 <= len(rows) <= MOST_BESIDE:
        raise InvalidValueError(
            f"also_at must be a list of 1 to {MOST_BESIDE} places with x_m, y_m, yaw_deg, "
            f"got {rows!r:.80}"
        )
    places = [shaped(f"also_at[{k}]", row, Place) for k, row in enumerate(rows)]
    return [np.array([at.x_m, at.y_m, math.radians(at.yaw_deg)]) for at in places]


class Mount(Place, frozen=True):
    """Where its scanner is."""

    height_m: Annotated[float, Meta(ge=0.05, le=1.0)] = SCAN_HEIGHT


class RobotFile(Table, frozen=True):
    """The tables of a robot; without its inertia, that of its shape."""

    name: Word
    mass_kg: Annotated[float, Meta(ge=0.1, le=500.0)]
    footprint: Footprint
    drive: Wheels
    scanner: Mount
    inertia_kgm2: Inertia = 0.0


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A robot on wheels.

    half_m   (half length, half width) m of a box, or (radius,) of a circle
    ahead_m  of the footprint's middle before the axle's, about which the robot turns
    scanner  x m, y m, yaw rad in the robot's frame, and height m above the floor
    """

    name: str
    mass_kg: float
    inertia_kgm2: float
    half_m: tuple[float, ...]
    ahead_m: float
    drive: DriveConfig
    scanner: tuple[float, float, float, float]

    @property
    def radius(self) -> float:
        """m, of the disc about the footprint's middle that holds it."""
        return math.hypot(*self.half_m)


def names() -> list[str]:
    """Robots that come with the project."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def read_robot(name: str) -> dict[str, Any]:
    """The tables of a robot by its name, or of a file; checked.

    Raises ``UnknownNameError`` for neither, ``LogFormatError`` that names the file and the field.
    """
    path = Path(name)
    if name in names():
        path = FOLDER / f"{name}.toml"
    elif path.suffix != ".toml":
        raise UnknownNameError(
            f"no robot is called {name!r:.80}. Known: {', '.join(names())}; or a .toml file."
        )
    tables = toml_of(path, MOST_BYTES)
    try:
        robot_of(tables)
    except InvalidValueError as error:
        raise LogFormatError(path, str(error)) from error
    return tables


def robot_of(given: str | Mapping[str, Any] | Robot) -> Robot:
    """A robot by its name, or from its tables; ``InvalidValueError`` names the table and field."""
    if isinstance(given, Robot):
        return given
    tables = read_robot(given) if isinstance(given, str) else given
    own: RobotFile = shaped("robot", tables, RobotFile)
    foot, drive, place = own.footprint, own.drive, own.scanner
    sizes = ("radius_m",) if foot.shape == "circle" else ("length_m", "width_m")
    for size in ("radius_m", "length_m", "width_m"):
        if (getattr(foot, size) > 0.0) != (size in sizes):
            raise InvalidValueError(
                f"robot: a {foot.shape} has {' and '.join(sizes)}, see footprint.{size}"
            )
    if (drive.kind == "car") != (drive.turn_radius_m > 0.0):
        raise InvalidValueError("robot: drive.turn_radius_m is what a car has, and no other")
    a, b = 0.5 * foot.length_m, 0.5 * foot.width_m
    circle = foot.shape == "circle"
    by_shape = 0.5 * foot.radius_m**2 if circle else (a**2 + b**2) / 3.0
    return Robot(
        name=own.name,
        mass_kg=own.mass_kg,
        inertia_kgm2=own.inertia_kgm2 or own.mass_kg * by_shape,
        half_m=(foot.radius_m,) if circle else (a, b),
        ahead_m=foot.ahead_m,
        drive=DriveConfig(
            v_max=drive.v_max_mps, omega_max=drive.omega_max_radps,
            accel=drive.accel_mps2, alpha=drive.alpha_radps2, track=drive.track_m,
            turn_radius=drive.turn_radius_m, sideways=drive.kind == "omnidirectional",
        ),
        scanner=(place.x_m, place.y_m, math.radians(place.yaw_deg), place.height_m),
    )  # fmt: skip


def with_robot(scene: Scene, robot: Robot) -> Scene:
    """The scene with that robot in the place of its own; the given one is left as it is."""
    raised = at_scan_height(scene, robot.scanner[3])
    spec = raised.spec.copy()
    body = spec.body("robot/base")
    share, inertia = robot.mass_kg / MASS_KG, robot.inertia_kgm2
    body.mass, body.ipos = robot.mass_kg, [robot.ahead_m, 0.0, body.ipos[2]]
    body.inertia = [inertia, inertia, inertia]
    for tyre, side in (("wl", 0.5), ("wr", -0.5)):
        site = spec.site(f"robot/{tyre}")
        site.pos = [0.0, side * robot.drive.track, site.pos[2]]
    for name in ("tyre_l", "tyre_r", "side"):
        actuator = spec.actuator(f"robot/{name}")
        actuator.forcerange = [share * limit for limit in actuator.forcerange]
        actuator.gainprm[0] *= share
        actuator.biasprm[2] *= share
    laser, (x, y, yaw, height) = spec.site("robot/laser"), robot.scanner
    laser.pos = [x, y, laser.pos[2]]
    laser.quat = [math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)]
    _footprint(spec, robot, (x, y, height))
    reach = robot.radius + abs(robot.ahead_m)  # about the axle, not about the footprint's middle
    movers = tuple(replace(m, radius=reach) if m.kind == "robot" else m for m in raised.movers)
    return replace(raised, spec=spec, movers=movers)


def _footprint(spec: mujoco.MjSpec, robot: Robot, scanner: tuple[float, float, float]) -> None:
    """The hull in its shape, and a plain body and scanner in place of the picture."""
    box, half_height = len(robot.half_m) == 2, max(0.02, 0.5 * scanner[2] - 0.03)
    kind = mujoco.mjtGeom.mjGEOM_BOX if box else mujoco.mjtGeom.mjGEOM_CYLINDER
    for geom in list(spec.body("robot/base").geoms):
        if geom.name == "robot/hull":
            geom.pos = [robot.ahead_m, 0.0, geom.pos[2]]
            if box:
                geom.type, geom.size = kind, [*robot.half_m, 0.1]
            else:
                geom.size = [robot.half_m[0], *geom.size[1:]]
            continue
        spec.delete(geom)
    size = [*robot.half_m, half_height][:3] if box else [robot.half_m[0], half_height, 0.0]
    bodies = ((kind, size, [robot.ahead_m, 0.0, half_height + 0.01], "paint_red"),)
    device = (mujoco.mjtGeom.mjGEOM_CYLINDER, [0.035, 0.03, 0.0], list(scanner), "plastic_black")
    for shape, half, pos, material in (*bodies, device):
        spec.body("robot/base").add_geom(
            type=shape, size=half, pos=pos, material=material, mass=0.0, group=1,
            contype=0, conaffinity=0,
        )  # fmt: skip

# SPDX-License-Identifier: Apache-2.0
"""What a recipe hands to the world: a model to compile and the facts a simulator needs about it."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes import SCAN_HEIGHT
from scenes.footprint import static_raster
from scenes.kinds import Group, joint_of_door, kind_of
from slam.errors import InvalidValueError
from slam.shaped import within
from slam.system import Raster

Kind = str
"""A key of ``scenes.kinds.KINDS``."""

Pose = tuple[float, float, float]
LASER = "robot/laser"
PICTURED = "robot/scanner"  # geoms whose names begin so are the scanner's picture
FOOT = "robot/scanner_foot"  # ... and this one stands on the deck
LOWEST, HIGHEST = 0.05, 1.0  # m; walls are cut at 1.1 m


@dataclass(frozen=True, kw_only=True)
class Mover:
    """Something that can move.

    name    prefix of its names in the model: body "<name>/base", joints "<name>/x|y|yaw"; for a
            door body "<name>/leaf", joint "<name>/hinge" or, of one that slides, "<name>/slide"
    kind    which part it is: a key of ``scenes.kinds.KINDS``, else ``UnknownNameError``
    radius  m, footprint disc of its hull; for a door the width of its leaf
    """

    name: str
    kind: Kind
    radius: float

    def __post_init__(self) -> None:
        kind_of(self.kind)

    @property
    def group(self) -> Group:
        """What moves it."""
        return kind_of(self.kind).group


@dataclass(frozen=True, kw_only=True)
class Role:
    """What somebody of a crowd does (``scenes.crowd``); whoever has none walks between all goals.

    does    "walk" from goal to goal, "follow" a leader, "queue", "clean" (take chairs along)
    leader  mover that is followed, the robot or a person
    slot    (m ahead, m left) of the leader
    goals   of the scene between which one walks; () for all
    stay    factor on the stays at goals
    slow    factor on the pace
    places  of a queue, (x, y) m, the first in line first; ``turn``: which one is one's own
    """

    does: str
    leader: str = ""
    slot: tuple[float, float] = (0.0, 0.0)
    goals: tuple[str, ...] = ()
    stay: float = 1.0
    slow: float = 1.0
    places: tuple[tuple[float, float], ...] = ()
    turn: int = 0


@dataclass(frozen=True, kw_only=True)
class Hold:
    """Somebody, or a thing before it in a train, that holds a thing.

    holder, held  movers
    pose          of what is held in the frame of the holder, x m, y m, yaw rad
    hinged        whether it may turn about the hand, as what is pulled does
    """

    holder: str
    held: str
    pose: Pose
    hinged: bool = False


@dataclass(frozen=True, kw_only=True)
class Scene:
    """One built room or building, the same for the same name, seed and options.

    spec         uncompiled; ``compile()`` gives the model
    movers       every movable thing, the robot last
    initial      world pose (x m, y m, yaw rad) of each mover at reset. For the planar ones this is
                 the qpos of "<name>/x|y|yaw"; for a door its hinge and the closed leaf's direction
    door_angles  rad, angle of each door at rest (of one that slides m, 0): qpos of "<name>/hinge"
                 at reset, and the closer's ``springref``, so that nothing moves by itself
    goals        room or spot -> (x, y) m, free floor at least 1.2 m from any door
    rooms        room -> (xmin, ymin, xmax, ymax) m of its floor
    bounds       xmin, ymin, xmax, ymax of the whole floor, m
    obstacles    (n, 5) static boxes a walker avoids: cx, cy, half_x, half_y m, yaw rad; desk tops
                 count
    start        the robot's pose at reset, equal to ``initial["robot"]``
    scan_height_m  of the robot's scanner above the floor; ``scenes.at_scan_height`` changes it
    roles        what those of a crowd do, by mover name
    holds        who holds what
    places       (kind, pose) of the plan's seats and spots, whether taken or not, and ("opening",
                 pose) of each doorway without a door
    plan_file    name of the MJCF file of its walls
    """

    name: str
    seed: int
    spec: mujoco.MjSpec
    movers: tuple[Mover, ...]
    initial: Mapping[str, Pose]
    door_angles: Mapping[str, float]
    goals: Mapping[str, tuple[float, float]]
    rooms: Mapping[str, tuple[float, float, float, float]]
    bounds: tuple[float, float, float, float]
    obstacles: NDArray[np.float64]
    start: Pose
    options: Mapping[str, object] = field(default_factory=dict)
    scan_height_m: float = SCAN_HEIGHT
    roles: Mapping[str, Role] = field(default_factory=dict)
    holds: tuple[Hold, ...] = ()
    places: tuple[tuple[str, Pose], ...] = ()
    plan_file: str = ""

    @property
    def can_move(self) -> Counter[Kind]:
        """How many of each kind can move, beside the robot."""
        return Counter(mover.kind for mover in self.movers if mover.group != "robot")

    @cached_property
    def static_map(self) -> Raster:
        """Truth at the scan plane from what never moves: 1 occupied, 0 free."""
        return static_raster(self.compile(), self.bounds, self.scan_height_m)

    def compile(self) -> mujoco.MjModel:
        """The model; its qpos0 is zero, as a planar qpos *is* the world pose: see ``place``.

        Raises ``InvalidValueError`` for what MuJoCo refuses.
        """
        return compiled(self.spec, f"scene '{self.name}'")

    def place(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Write ``initial`` and ``door_angles`` into ``data.qpos`` (velocities stay untouched)."""
        for mover in self.movers:
            if mover.group == "door":
                joint = f"{mover.name}/{joint_of_door(mover.kind)}"
                data.qpos[_address(model, joint)] = self.door_angles[mover.name]
                continue
            for joint, value in zip(("x", "y", "yaw"), self.initial[mover.name], strict=True):
                data.qpos[_address(model, f"{mover.name}/{joint}")] = value


def compiled(spec: mujoco.MjSpec, what: str) -> mujoco.MjModel:
    """The model of a spec; ``InvalidValueError`` says what it is of, and why MuJoCo refuses it."""
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        words = " ".join(str(error).split())
        raise InvalidValueError(f"{what}: no model that can be used: {words}") from None


def at_scan_height(scene: Scene, scan_height_m: float) -> Scene:
    """The scene with the robot's scanner so high above the floor; the given one is left as it is.

    At 0.1 m a five-star chair shows its arms, at 0.36 m its column, at 0.46 m the edge of its seat.
    Raises ``InvalidValueError`` outside 0.05 to 1 m.
    """
    height = within("scan_height_m", scan_height_m, LOWEST, HIGHEST)
    if height == scene.scan_height_m:
        return scene
    spec, up = scene.spec.copy(), height - scene.scan_height_m
    site = spec.site(LASER)
    if site is not None:
        site.pos = [site.pos[0], site.pos[1], site.pos[2] + up]
    for geom in spec.geoms:
        if not geom.name.startswith(PICTURED):
            continue
        rise = up
        if geom.name == FOOT:  # longer or shorter; sunk in the chassis with a low scanner
            rise = 0.5 * max(up, 2.0 * (0.005 - float(geom.size[2])))
            geom.size = [geom.size[0], geom.size[1], geom.size[2] + rise]
        geom.pos = [geom.pos[0], geom.pos[1], geom.pos[2] + rise]
    return replace(scene, spec=spec, scan_height_m=height)


def _address(model: mujoco.MjModel, joint: str) -> int:
    return int(model.joint(joint).qposadr[0])

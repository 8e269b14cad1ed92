# SPDX-License-Identifier: Apache-2.0
"""The elements and attributes of MJCF that a file from elsewhere may hold, with their bounds.

The defaults of the tables stand for nothing: MuJoCo has its own.
"""

from typing import Annotated, Literal

from msgspec import Meta, field

from slam.shaped import PRINTABLE, Share, Table

Metres = Annotated[float, Meta(ge=-1e4, le=1e4)]
Size = Annotated[float, Meta(gt=0.0, le=1e4)]
Strength = Annotated[float, Meta(ge=0.0, le=1e5)]  # kg, kg m2, N, N s/m, N m s/rad
Word = Annotated[str, Meta(max_length=100, pattern=PRINTABLE)]
Bits = Annotated[int, Meta(ge=0, le=0xFFFF)]
Group = Annotated[int, Meta(ge=0, le=5)]
Degrees = Annotated[float, Meta(gt=0.0, lt=180.0)]
Switch = Literal["true", "false"]
Limited = Literal["true", "false", "auto"]
Sizes = Annotated[tuple[Annotated[float, Meta(ge=0.0, le=1e4)], ...], Meta(max_length=3)]
Shares = Annotated[tuple[Share, ...], Meta(min_length=3, max_length=4)]
Vector = tuple[Metres, Metres, Metres]
Vectors = tuple[Metres, Metres, Metres, Metres, Metres, Metres]
ZERO = (0.0, 0.0, 0.0)


class Named(Table, frozen=True, kw_only=True):
    """What most elements have."""

    name: Word = ""
    class_: Word = field(name="class", default="")


class Placed(Named, frozen=True, kw_only=True):
    """Angles are in rad."""

    pos: Vector = ZERO
    quat: tuple[Metres, Metres, Metres, Metres] = (1.0, 0.0, 0.0, 0.0)
    euler: Vector = ZERO


class Site(Placed, frozen=True, kw_only=True):
    """A mark."""

    type: Literal["plane", "sphere", "capsule", "ellipsoid", "cylinder", "box"] = "sphere"
    size: Sizes = ()
    fromto: Vectors = (*ZERO, *ZERO)
    group: Group = 0
    material: Word = ""
    rgba: Shares = ()


class Geom(Site, frozen=True, kw_only=True):
    """A wall, a floor, or a piece of something."""

    contype: Bits = 0
    conaffinity: Bits = 0
    condim: Literal[1, 3, 4, 6] = 3
    friction: Sizes = ()
    mass: Strength = 0.0
    density: Strength = 0.0
    castshadow: Switch = "true"


class Camera(Placed, frozen=True, kw_only=True):
    """A view for pictures."""

    projection: Literal["perspective", "orthographic"] = "perspective"
    fovy: Degrees = 45.0
    xyaxes: Vectors = (*ZERO, *ZERO)


class Light(Named, frozen=True, kw_only=True):
    """Light for pictures."""

    type: Literal["directional", "spot", "point"] = "directional"
    pos: Vector = ZERO
    dir: Vector = ZERO
    ambient: Shares = ()
    diffuse: Shares = ()
    specular: Shares = ()
    castshadow: Switch = "true"


class Body(Placed, frozen=True, kw_only=True):
    """Geoms that belong together."""

    childclass: Word = ""
    mocap: Switch = "false"


class Joint(Named, frozen=True, kw_only=True):
    """One way in which a body of a part moves."""

    type: Literal["slide", "hinge"] = "hinge"
    pos: Vector = ZERO
    axis: Vector = ZERO
    range: tuple[Metres, Metres] = (0.0, 0.0)
    limited: Limited = "auto"
    frictionloss: Strength = 0.0
    damping: Strength = 0.0
    stiffness: Strength = 0.0
    armature: Strength = 0.0


class Inertial(Table, frozen=True, kw_only=True):
    """The mass of a body of a part."""

    pos: Vector
    mass: Strength
    diaginertia: tuple[Strength, Strength, Strength]


class Velocity(Named, frozen=True, kw_only=True):
    """What drives a part."""

    joint: Word = ""
    site: Word = ""
    gear: Annotated[tuple[Metres, ...], Meta(max_length=6)] = ()
    kv: Strength = 1.0
    forcelimited: Limited = "auto"
    forcerange: tuple[Metres, Metres] = (0.0, 0.0)


class Material(Named, frozen=True, kw_only=True):
    """A colour, and what the laser meets: the first word of the name."""

    rgba: Shares = ()
    specular: Share = 0.5
    shininess: Share = 0.5
    emission: Share = 0.0
    reflectance: Share = 0.0


class Statistic(Table, frozen=True, kw_only=True):
    """What pictures go by."""

    center: Vector = ZERO
    extent: Size = 1.0
    meansize: Size = 1.0


class Compiler(Table, frozen=True):
    """Angles are in radians."""

    angle: Literal["radian"] = "radian"


class Model(Table, frozen=True):
    """The whole."""

    model: Word = ""


class Include(Table, frozen=True):
    """One of ours, whatever its folder."""

    file: Word


class Default(Table, frozen=True):
    """A class of elements."""

    class_: Word = field(name="class", default="")


class Plain(Table, frozen=True):
    """Nothing but elements."""


ATTRIBUTES: dict[str, type[Table]] = {
    "mujoco": Model, "include": Include, "compiler": Compiler, "statistic": Statistic,
    "default": Default, "asset": Plain, "material": Material, "worldbody": Plain,
    "geom": Geom, "site": Site, "camera": Camera, "light": Light, "body": Body,
    "joint": Joint, "inertial": Inertial, "actuator": Plain, "velocity": Velocity,
}  # fmt: skip
_PLAN: dict[str, tuple[str, ...]] = {
    "": ("mujoco",),
    "mujoco": ("include", "compiler", "statistic", "default", "asset", "worldbody"),
    "default": ("default", "geom", "site", "camera", "light", "material"),
    "asset": ("material",),
    "worldbody": ("geom", "site", "camera", "light", "body"),
    "body": ("geom", "body"),
}
HOLDS = {
    "plans": _PLAN,
    "parts": {
        **_PLAN,
        "mujoco": (*_PLAN["mujoco"], "actuator"),
        "default": (*_PLAN["default"], "joint", "velocity"),
        "body": ("geom", "body", "site", "camera", "joint", "inertial"),
        "actuator": ("velocity",),
    },
}
"""What an element holds: of a plan, which stands still, and of a part, which may move."""

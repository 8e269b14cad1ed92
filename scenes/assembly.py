# SPDX-License-Identifier: Apache-2.0
"""Parts put side by side under their names, then into a scene all at once.

A part is attached under a prefix ("chair3/"), which MuJoCo also puts before the part's references
to materials; so a part's own materials are dropped and the prefix is stripped from the reference.
Attaching costs more the bigger the scene is, so parts first meet in a spec of their own: one for
all whose names differ in the number only ("chair0", "chair1", ...).
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path

import mujoco

from scenes.kinds import KINDS, kind_of
from scenes.marks import Mark, marks
from scenes.plan_file import checked
from scenes.scene import Mover, Pose
from slam.errors import InvalidValueError

HERE = Path(__file__).parent
# What a plan and a part share with all others, by their folder; later ones build on earlier ones.
SHARED = {"plans": ("parts/common.xml", "plans/world.xml"), "parts": ("parts/common.xml",)}
MOST_PARTS = 1000  # put at once: what they cost grows by the square, 1000 chairs take 5 s
LIMBS = ("thigh_l", "shank_l", "thigh_r", "shank_r")


def file_of(folder: str, name: str) -> Path:
    """The MJCF file of a part or plan: one of ours by its name, anybody's by its path."""
    if folder == "parts" and name in KINDS:
        name = KINDS[name].part or name
    path = Path(name) if name.endswith(".xml") else HERE / folder / f"{name}.xml"
    if not path.is_file():
        if folder == "plans" and name.endswith(".xml"):
            raise InvalidValueError(f"{path}: no such file, expected the MJCF file of a plan")
        known = f"; there are {', '.join(ours(folder))}" if folder == "parts" else ""
        raise InvalidValueError(f"no file '{path.name}' for '{name}' among the {folder}{known}")
    return path


@cache
def ours(folder: str) -> tuple[str, ...]:
    """Names of our own "plans" or "parts", sorted."""
    shared = {Path(name).name for names in SHARED.values() for name in names}
    return tuple(sorted(p.stem for p in (HERE / folder).glob("*.xml") if p.name not in shared))


def parsed(folder: str, name: str) -> mujoco.MjSpec:
    """The spec of a plan or part; ``InvalidValueError`` names a file that cannot be read, and why.

    A file from elsewhere has the materials and classes of ours, and angles in radians, whether it
    includes them or not; one of ours must include them.
    """
    path = file_of(folder, name)
    texts = {file.name: file.read_bytes() for file in (HERE / own for own in SHARED[folder])}
    text = None if path.parent == HERE / folder else checked(path, folder, tuple(texts))
    try:
        if text is None:
            return mujoco.MjSpec.from_file(str(path))
        return mujoco.MjSpec.from_string(text, include=texts)
    except ValueError as error:
        words = " ".join(str(error).split())
        raise InvalidValueError(f"{path}: no MJCF that can be used: {words}") from None


def check_materials(spec: mujoco.MjSpec, geoms: Iterable[mujoco.MjsGeom], where: str) -> None:
    """Raise ``InvalidValueError`` for a material that the spec does not have; names what it has."""
    known = {material.name for material in spec.materials}
    for geom in geoms:
        if geom.material and geom.material not in known:
            kept = sorted(n for n in known if not n.startswith(("shirt_", "trousers_", "hair_")))
            what = f"geom '{geom.name}'" if geom.name else f"a geom of '{geom.parent.name}'"
            raise InvalidValueError(
                f"{where}: {what} has the unknown material '{geom.material}'. "
                f"There are: {', '.join(kept)}"
            )


def moved(pose: Pose, local: Pose) -> Pose:
    """``local``, given in the frame of ``pose``, in the world."""
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    turned = math.remainder(yaw + local[2], math.tau)
    return x + cos * local[0] - sin * local[1], y + sin * local[0] + cos * local[1], turned


@cache
def part(name: str) -> mujoco.MjSpec:
    """The parsed part without its materials; copy before use."""
    spec = parsed("parts", name)
    for material in list(spec.materials):
        spec.delete(material)
    return spec


@cache
def part_marks(name: str) -> tuple[Mark, ...]:
    """The marks of a part, in its own frame."""
    return marks(part(name))


@cache
def hull_radius(name: str) -> float:
    """Radius of a planar part's hull, m."""
    return float(part(name).geom("hull").size[0])


@cache
def corners(name: str) -> tuple[tuple[float, float, float], ...]:
    """(x, y, radius) m of a planar part's hulls beside the row along its x axis, in its frame."""
    hulls = (geom for geom in part(name).geoms if geom.name.rstrip("0123456789") == "hull")
    discs = [(float(g.pos[0]), float(g.pos[1]), float(g.size[0])) for g in hulls]
    return tuple(disc for disc in discs if disc[1] != 0.0)


def hulls(name: str) -> tuple[tuple[float, float, float], ...]:
    """(x, y, radius) m of all hulls of a planar part, in its frame."""
    half, radius = kind_of(name).half_length_m, hull_radius(name)
    row = (0.0,) if half == 0.0 else (-half, 0.0, half)
    return (*((x, 0.0, radius) for x in row), *corners(name))


def discs_of(kind: str, pose: Sequence[float]) -> list[tuple[float, float, float]]:
    """(x, y, radius) m of the hulls of a planar thing at a pose."""
    x, y, yaw = pose
    return [(*moved((x, y, yaw), (u, v, 0.0))[:2], radius) for u, v, radius in hulls(kind)]


def reach_of(name: str) -> float:
    """Radius of the disc around a planar part that holds all its hulls, m."""
    return max(math.hypot(x, y) + radius for x, y, radius in hulls(name))


def room_of(mover: Mover) -> float:
    """Radius m of the disc that a thing is given where it is put elsewhere; of a door its leaf.

    It holds all hulls of what has hulls at its corners, of everything else the middle one.
    """
    long = mover.group != "door" and corners(mover.kind)
    return reach_of(mover.kind) if long else mover.radius


class Assembly:
    """Parts on their way into a scene."""

    def __init__(self) -> None:
        self._groups: dict[str, mujoco.MjSpec] = {}
        self._count = 0

    def put(
        self,
        name: str,
        instance: str,
        pose: Pose,
        prepare: Callable[[mujoco.MjSpec], None] | None = None,
    ) -> None:
        """Put a copy of part ``name``, altered by ``prepare``, at ``pose`` as ``instance``.

        Raises ``InvalidValueError`` from ``MOST_PARTS`` on.
        """
        self._count += 1
        if self._count > MOST_PARTS:
            raise InvalidValueError(
                f"'{instance}' is one too many: a plan has at most {MOST_PARTS} pieces of "
                f"furniture, and a scene as many things that move"
            )
        child = part(name).copy()
        if prepare:
            prepare(child)
        kin = instance.rstrip("0123456789")
        group = self._groups.setdefault(kin, mujoco.MjSpec())
        frame = group.worldbody.add_frame(pos=[pose[0], pose[1], 0.0], quat=quaternion(pose[2]))
        group.attach(child, frame=frame, prefix=f"{instance.removeprefix(kin)}/")

    def put_mover(self, kind: str, name: str, pose: Pose, paint: Mapping[str, str]) -> Mover:
        """Put something planar that moves; ``paint``: materials of the part by those in the file.

        ``UnknownNameError`` for a kind without a row in ``scenes.kinds``.
        """
        person = kind_of(kind).group == "person"

        def prepare(child: mujoco.MjSpec) -> None:
            repaint(child, paint)
            if person:
                _stand(child, pose)

        self.put(kind, name, (0.0, 0.0, 0.0), prepare)
        return Mover(name=name, kind=kind, radius=hull_radius(kind))

    def into(self, spec: mujoco.MjSpec) -> None:
        """Hand everything over to ``spec``, whose materials the parts use from now on.

        Raises ``InvalidValueError`` for a material that ``spec`` does not have, and for two cameras
        of one name.
        """
        for kin, group in self._groups.items():
            geoms = group.geoms  # still the same geoms once attached
            spec.attach(group, frame=spec.worldbody.add_frame(), prefix=kin)
            for geom in geoms:
                geom.material = geom.material.rpartition("/")[2]
            check_materials(spec, geoms, f"part '{kin}'")
        self._groups = {}
        for camera in spec.cameras:
            name = camera.name.rpartition("/")[2]
            try:
                camera.name = name
            except ValueError:
                raise InvalidValueError(
                    f"camera '{name}': there are two of that name; 'follow' is the robot's"
                ) from None


def repaint(child: mujoco.MjSpec, paint: Mapping[str, str]) -> None:
    """Give the geoms of a copy of a part other materials; ``paint``: by those in the file."""
    for geom in child.geoms if paint else ():
        geom.material = paint.get(geom.material, geom.material)


def _stand(child: mujoco.MjSpec, pose: Pose) -> None:
    """Put the mocap limbs under the torso; the gait moves them from then on."""
    for limb in LIMBS:
        body = child.body(limb)
        x, y, yaw = moved(pose, (float(body.pos[0]), float(body.pos[1]), 0.0))
        body.pos, body.quat = [x, y, body.pos[2]], quaternion(yaw)


def length_of(geom: mujoco.MjsGeom) -> float:
    """m, of its longer side; of what has no end, a plane, 0."""
    if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
        return 0.0
    ends = geom.fromto if math.isfinite(geom.fromto[0]) else (0.0,) * 6
    return 2.0 * float(max(geom.size[:2])) + math.dist(ends[:3], ends[3:])


def quaternion(yaw: float) -> list[float]:
    """Of a turn about the vertical."""
    return [math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)]

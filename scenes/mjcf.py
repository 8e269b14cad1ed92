# SPDX-License-Identifier: Apache-2.0
"""MJCF files of plans and parts: ours by name, anybody's by path, checked before they are used.

A file of ours includes what all share. A file from elsewhere need not: it is given the same.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import mujoco

from scenes.kinds import KINDS
from slam.errors import InvalidValueError

HERE = Path(__file__).parent
# What a plan and a part share with all others, by their folder; later ones build on earlier ones.
SHARED = {"plans": ("parts/common.xml", "plans/world.xml"), "parts": ("parts/common.xml",)}
MAX_BYTES = 1 << 24  # of a file from elsewhere


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
    includes them or not.
    """
    path = file_of(folder, name)
    try:
        if path.parent == HERE / folder:
            return mujoco.MjSpec.from_file(str(path))
        if path.stat().st_size > MAX_BYTES:
            raise ValueError(f"it is larger than {MAX_BYTES >> 20} MB")
        return _from_elsewhere(path, SHARED[folder])
    except (ValueError, ElementTree.ParseError, OSError) as error:
        words = " ".join(str(error).split())
        raise InvalidValueError(f"{path}: no MJCF that can be used: {words}") from error


def _from_elsewhere(path: Path, shared: tuple[str, ...]) -> mujoco.MjSpec:
    root = ElementTree.fromstring(path.read_bytes())
    included = {Path(element.get("file", "")).name for element in root.iter("include")}
    missing = [HERE / name for name in shared if Path(name).name not in included]
    if len(missing) < len(shared):  # it includes some by a path of its own
        return mujoco.MjSpec.from_file(str(path))
    for place, file in enumerate(missing):
        root.insert(place, ElementTree.Element("include", file=file.name))
    texts = {file.name: file.read_bytes() for file in missing}
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"), include=texts)
    spec.modelfiledir = str(path.parent.resolve())  # where its meshes and textures lie
    return spec


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

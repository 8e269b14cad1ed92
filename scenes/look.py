# SPDX-License-Identifier: Apache-2.0
"""How things look: painted floors, caps and skirting of walls, clothes and upholstery."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from scenes import textures
from scenes.marks import yaw_of

WALLS = ("wall", "parapet", "glass")  # first words of the names of what walls off
CAP_HEIGHT = 0.012
SKIRTING = (0.008, 0.04)  # how far it stands out, half height, m
PANE_HEIGHT = 0.28  # half height of a pane on a parapet, m

# colour name -> red, green, blue; the drawing without GL uses them too
SHIRTS = {
    "teal": (0.10, 0.45, 0.46),
    "mustard": (0.82, 0.64, 0.16),
    "plum": (0.45, 0.16, 0.34),
    "sky": (0.40, 0.62, 0.82),
    "white": (0.90, 0.90, 0.88),
    "navy": (0.12, 0.18, 0.36),
    "coral": (0.86, 0.38, 0.28),
    "moss": (0.30, 0.42, 0.22),
    "grey": (0.48, 0.49, 0.52),
    "brick": (0.62, 0.20, 0.15),
}
TROUSERS = {
    "black": (0.08, 0.08, 0.10),
    "denim": (0.17, 0.26, 0.42),
    "khaki": (0.58, 0.50, 0.37),
    "grey": (0.32, 0.33, 0.36),
    "brown": (0.30, 0.20, 0.14),
}
HAIR = {
    "black": (0.06, 0.05, 0.05),
    "brown": (0.25, 0.15, 0.09),
    "blond": (0.72, 0.56, 0.30),
    "ginger": (0.55, 0.26, 0.11),
    "grey": (0.60, 0.60, 0.60),
}
SKIN = {
    "a": (0.93, 0.76, 0.65),
    "b": (0.85, 0.65, 0.52),
    "c": (0.70, 0.49, 0.36),
    "d": (0.48, 0.32, 0.23),
}
UPHOLSTERY = ("fabric_blue", "fabric_blue", "fabric_blue", "fabric_teal", "fabric_slate")


WARDROBES: Mapping[str, Mapping[str, tuple[float, float, float]]] = {
    "shirt": SHIRTS,
    "trousers": TROUSERS,
    "hair": HAIR,
    "skin": SKIN,
}


def dress(rng: np.random.Generator) -> Mapping[str, str]:
    """Materials of one person: part's name -> wardrobe's name."""
    return {slot: f"{slot}_{rng.choice(sorted(wardrobe))}" for slot, wardrobe in WARDROBES.items()}


def upholster(rng: np.random.Generator) -> Mapping[str, str]:
    """Fabric of one swivel chair."""
    return {"fabric_blue": str(rng.choice(UPHOLSTERY))}


def paint_floors(spec: mujoco.MjSpec, more: Sequence[str] = ()) -> None:
    """Give the floor materials in use, and ``more``, their textures."""
    used = {geom.material for geom in spec.geoms} | set(more)
    for material in sorted(used & textures.PAINTERS.keys()):
        data, n, size_m = textures.floor(material)
        texture = spec.add_texture(
            name=material, type=mujoco.mjtTexture.mjTEXTURE_2D, width=n, height=n, nchannel=3
        )
        texture.data = data
        surface = spec.material(material)
        surface.texuniform = True
        surface.texrepeat = [1.0 / size_m, 1.0 / size_m]
        roles = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
        roles[int(mujoco.mjtTextureRole.mjTEXROLE_RGB)] = material
        surface.textures = roles


def trim_walls(spec: mujoco.MjSpec) -> None:
    """Caps and skirting boards, panes on parapets, rails of glass walls; nothing where hidden."""
    for wall in list(spec.geoms):
        kind, _, name = wall.name.partition(":")
        if kind not in WALLS or wall.group != 0:
            continue
        (x, y, z), (a, b, c) = wall.pos, wall.size
        quat = [math.cos(0.5 * yaw_of(wall)), 0.0, 0.0, math.sin(0.5 * yaw_of(wall))]
        top = z + c
        if kind == "glass":
            rail = [max(half, 0.03) for half in (a, b)]
            for which, height in (("rail", 0.03), ("cap", top)):
                _trim(spec, f"{which}:{name}", (x, y, height), (*rail, 0.03), "metal_dark", quat)
            continue
        if kind == "parapet":
            pane = [min(half, 0.012) if half < 0.1 else half for half in (a, b)]
            _trim(
                spec, f"pane:{name}", (x, y, top + PANE_HEIGHT), (*pane, PANE_HEIGHT), "glass", quat
            )
            top += 2.0 * PANE_HEIGHT - 0.01
        out, half = SKIRTING
        _trim(
            spec, f"cap:{name}", (x, y, top), (a + 0.006, b + 0.006, CAP_HEIGHT), "wall_cap", quat
        )
        _trim(spec, f"skirting:{name}", (x, y, half), (a + out, b + out, half), "wall_base", quat)


def _trim(
    spec: mujoco.MjSpec,
    name: str,
    pos: tuple[float, float, float],
    size: tuple[float, float, float],
    material: str,
    quat: Sequence[float],
) -> None:
    (spec.body("trim") or spec.worldbody.add_body(name="trim")).add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=pos,
        size=size,
        quat=quat,
        material=material,
        contype=0,
        conaffinity=0,
        group=0,
        castshadow=False,
    )


def fill_wardrobe(spec: mujoco.MjSpec) -> None:
    """All materials that ``dress`` may name."""
    for slot, wardrobe in WARDROBES.items():
        for colour, rgb in wardrobe.items():
            spec.add_material(
                name=f"{slot}_{colour}", rgba=[*rgb, 1.0], specular=0.02, shininess=0.1
            )

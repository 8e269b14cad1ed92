# SPDX-License-Identifier: Apache-2.0
"""How things look: painted floors, caps and skirting of walls, clothes and upholstery."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from scenes import textures

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


def dress(rng: np.random.Generator) -> Mapping[str, str]:
    """Materials of one person: part's name -> wardrobe's name."""
    return {
        slot: f"{slot}_{rng.choice(sorted(wardrobe))}"
        for slot, wardrobe in (
            ("shirt", SHIRTS),
            ("trousers", TROUSERS),
            ("hair", HAIR),
            ("skin", SKIN),
        )
    }


def upholster(rng: np.random.Generator) -> Mapping[str, str]:
    """Fabric of one swivel chair."""
    return {"fabric_blue": str(rng.choice(UPHOLSTERY))}


def finish(spec: mujoco.MjSpec) -> None:
    """Everything that is the same for all scenes, once all parts are attached."""
    for geom in spec.geoms:
        geom.material = geom.material.rpartition("/")[2]
    for camera in spec.cameras:
        camera.name = camera.name.rpartition("/")[2]
    _trim_walls(spec)
    _make_wardrobe(spec)
    _paint_floors(spec)


def _paint_floors(spec: mujoco.MjSpec) -> None:
    used = {geom.material for geom in spec.geoms}
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


def _trim_walls(spec: mujoco.MjSpec) -> None:
    for wall in list(spec.geoms):
        kind, _, name = wall.name.partition(":")
        if kind not in ("wall", "parapet"):
            continue
        (x, y, z), (a, b, c) = wall.pos, wall.size
        top = z + c
        if kind == "parapet":
            _trim(spec, f"pane:{name}", (x, y, top + PANE_HEIGHT), (0.012, b, PANE_HEIGHT), "glass")
            top += 2.0 * PANE_HEIGHT - 0.01
        out, half = SKIRTING
        _trim(spec, f"cap:{name}", (x, y, top), (a + 0.006, b + 0.006, CAP_HEIGHT), "wall_cap")
        _trim(spec, f"skirting:{name}", (x, y, half), (a + out, b + out, half), "wall_base")


def _trim(
    spec: mujoco.MjSpec,
    name: str,
    pos: tuple[float, float, float],
    size: tuple[float, float, float],
    material: str,
) -> None:
    (spec.body("trim") or spec.worldbody.add_body(name="trim")).add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=pos,
        size=size,
        material=material,
        contype=0,
        conaffinity=0,
        group=0,
        castshadow=False,
    )


def _make_wardrobe(spec: mujoco.MjSpec) -> None:
    """Materials that ``dress`` named, as far as they are worn."""
    used = {geom.material for geom in spec.geoms}
    for slot, wardrobe in (
        ("shirt", SHIRTS),
        ("trousers", TROUSERS),
        ("hair", HAIR),
        ("skin", SKIN),
    ):
        for colour, rgb in wardrobe.items():
            if f"{slot}_{colour}" in used:
                spec.add_material(
                    name=f"{slot}_{colour}", rgba=[*rgb, 1.0], specular=0.02, shininess=0.1
                )

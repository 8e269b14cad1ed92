# SPDX-License-Identifier: Apache-2.0
"""What the surfaces of a model are to a beam of 905 nm, by the names of their materials."""

from functools import cache
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from slam.frames import Float

# Material name, or how it begins -> reflectivity at 905 nm. TD p7 lists black cardboard 10 %, grey
# cardboard 20, raw pine 40, grey PVC 50, white paper 80, metals 110 and more, black rubber 2; what
# cloth and painted things have is inferred from those classes.
REFLECTIVITY = MappingProxyType(
    {
        "wall": 0.80, "paper": 0.80, "paint": 0.40, "pot": 0.50, "soil": 0.15, "leaf": 0.50,
        "desk": 0.50, "wood": 0.40, "wood_frame": 0.80, "wood_cabinet_front": 0.80,
        "wood_dark": 0.20, "metal": 1.20, "metal_dark": 1.10, "metal_white": 0.80,
        "plastic": 0.50, "plastic_black": 0.05, "plastic_white": 0.80, "plastic_bin": 0.20,
        "rubber": 0.02, "screen": 0.10, "fabric": 0.30, "floor": 0.30, "ground": 0.30,
        "skin": 0.50, "hair": 0.10, "shirt": 0.40, "trousers": 0.20, "trousers_black": 0.08,
        "shoe": 0.08, "glass": 0.05, "mirror": 1.40, "metal_polished": 1.40, "chrome": 1.40,
    }
)  # fmt: skip
DEFAULT_REFLECTIVITY = 0.50

# What throws a beam on as a mirror does: part of it (panes), nearly all of it (polished things).
PANES = ("glass",)
POLISHED = ("mirror", "metal_polished", "chrome")


@cache
def reflectivity_of(material: str) -> float:
    """Of a material by its name without prefix: the longest entry of the table it begins with."""
    name = material.rsplit("/", 1)[-1]
    known = [key for key in REFLECTIVITY if name == key or name.startswith(key + "_")]
    return REFLECTIVITY[max(known, key=len)] if known else DEFAULT_REFLECTIVITY


def geom_reflectivity(model: mujoco.MjModel) -> Float:
    """(ngeom,) by the name of each geom's material."""
    of_material = [reflectivity_of(model.mat(i).name) for i in range(model.nmat)]
    table: Float = np.array([*of_material, DEFAULT_REFLECTIVITY])
    of_geom: NDArray[Any] = table[model.geom_matid]
    return of_geom


def _called(model: mujoco.MjModel, names: tuple[str, ...]) -> NDArray[np.bool_]:
    """(ngeom,) True where the material's name is one of ``names``, or begins with it and ``_``."""
    bare = [model.mat(i).name.rsplit("/", 1)[-1] for i in range(model.nmat)]
    table = np.array([any(b == n or b.startswith(n + "_") for n in names) for b in bare] + [False])
    of_geom: NDArray[Any] = table[model.geom_matid]
    return of_geom


def glass_geoms(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """(ngeom,) True for panes: material ``glass`` or ``glass_...``."""
    return _called(model, PANES)


def polished_geoms(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """(ngeom,) True for ``mirror``, ``metal_polished``, ``chrome`` and what begins with these."""
    return _called(model, POLISHED)

# SPDX-License-Identifier: Apache-2.0
"""How things look: painted floors, caps and skirting of walls, clothes and upholstery.

Floors are painted by numpy into textures that live in the model: no image files. A painter returns
an (n, n, 3) float image in [0, 1] that tiles seamlessly. No recorded value depends on a pixel.
"""

import itertools
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.assembly import quaternion
from scenes.marks import yaw_of

Image = NDArray[np.float32]


def _noise(rng: np.random.Generator, n: int, sigma_x: float, sigma_y: float) -> Image:
    """(n, n) smooth noise of unit standard deviation that wraps round."""
    pad = n // 4
    raw = rng.standard_normal((n, n)).astype(np.float32)
    smooth = _wrapped(raw, pad)
    size = tuple(1 + 2 * round(0.94 * sigma) for sigma in (sigma_x, sigma_y))
    for _ in range(3):  # three boxes are nearly a Gaussian, and quick at any width
        smooth = cv2.blur(smooth, size)
    smooth = smooth[pad:-pad, pad:-pad]
    return np.asarray(smooth / smooth.std(), dtype=np.float32)


def _wrapped(image: NDArray[np.float32], pad: int) -> Image:
    return np.asarray(cv2.copyMakeBorder(image, pad, pad, pad, pad, cv2.BORDER_WRAP))


def planks(size_m: float = 4.0, n: int = 1024) -> Image:
    """Oak planks 0.2 m wide along x, of random lengths, with grain and fine joints."""
    rng = np.random.default_rng(11)
    tone = np.zeros((n, n), dtype=np.float32)
    joint = np.zeros((n, n), dtype=np.float32)
    rows = round(size_m / 0.2)
    edges = np.linspace(0, n, rows + 1).round().astype(int)
    for top, bottom in itertools.pairwise(edges):
        cuts = _cuts(rng, n, shortest=round(0.9 / size_m * n), longest=round(1.9 / size_m * n))
        shift = int(rng.integers(n))
        row = np.zeros(n, dtype=np.float32)
        for left, right in itertools.pairwise(cuts):
            row[left:right] = rng.normal(0.0, 1.0)
        ends = np.zeros(n, dtype=np.float32)
        ends[np.asarray(cuts[:-1])] = 1.0
        tone[top:bottom] = np.roll(row, shift)
        joint[top:bottom] = np.maximum(joint[top:bottom], np.roll(ends, shift))
        joint[top] = 1.0
    grain = _noise(rng, n, 28.0, 0.9) + 0.6 * _noise(rng, n, 90.0, 3.0)
    light = 1.0 + 0.055 * tone + 0.028 * grain
    joint = cv2.GaussianBlur(_wrapped(joint, 4), (0, 0), 0.55)[4:-4, 4:-4]
    warm = np.array([0.83, 0.665, 0.475], dtype=np.float32)
    image = warm * light[..., None] ** np.array([0.9, 1.0, 1.25], dtype=np.float32)
    return _clip(image * (1.0 - 0.5 * joint[..., None]))


def carpet(size_m: float = 2.0, n: int = 512) -> Image:
    """Carpet tiles of 0.5 m, laid quarter-turned, blue-grey with a few lighter ones."""
    rng = np.random.default_rng(12)
    tiles = round(size_m / 0.5)
    step = n // tiles
    image = np.empty((n, n, 3), dtype=np.float32)
    along, across = _noise(rng, n, 4.0, 0.7), _noise(rng, n, 0.7, 4.0)
    for i in range(tiles):
        for j in range(tiles):
            box = np.s_[i * step : (i + 1) * step, j * step : (j + 1) * step]
            pile = (along if (i + j) % 2 else across)[box]
            base = np.array([0.44, 0.50, 0.565]) * rng.normal(1.0, 0.03)
            image[box] = base * (1.0 + 0.05 * pile[..., None])
            image[box][0] *= 0.93
            image[box][:, 0] *= 0.93
    speckle = rng.standard_normal((n, n, 1)).astype(np.float32)
    return _clip(image * (1.0 + 0.06 * speckle))


def felt(size_m: float = 2.0, n: int = 512) -> Image:
    """Needle felt, one piece, warm grey-green."""
    del size_m
    rng = np.random.default_rng(13)
    mottle = 0.035 * _noise(rng, n, 14.0, 14.0) + 0.05 * _noise(rng, n, 1.0, 1.0)
    base = np.array([0.50, 0.53, 0.49], dtype=np.float32)
    return _clip(base * (1.0 + mottle[..., None]))


def vinyl(size_m: float = 1.2, n: int = 384) -> Image:
    """Pale vinyl tiles of 0.6 m with thin joints."""
    rng = np.random.default_rng(14)
    step = round(0.6 / size_m * n)
    image = np.empty((n, n, 3), dtype=np.float32)
    image[:] = np.array([0.74, 0.74, 0.71], dtype=np.float32)
    image *= (1.0 + 0.012 * _noise(rng, n, 9.0, 9.0) + 0.015 * _noise(rng, n, 1.0, 1.0))[..., None]
    for line in range(0, n, step):
        image[line : line + 2] *= 0.86
        image[:, line : line + 2] *= 0.86
    return _clip(image)


def concrete(size_m: float = 6.0, n: int = 768) -> Image:
    """Ground concrete, cloudy, with one expansion joint each way."""
    del size_m
    rng = np.random.default_rng(15)
    clouds = 0.030 * _noise(rng, n, 60.0, 60.0) + 0.022 * _noise(rng, n, 12.0, 12.0)
    base = np.array([0.62, 0.62, 0.605], dtype=np.float32)
    image = base * (1.0 + clouds + 0.022 * _noise(rng, n, 0.8, 0.8))[..., None]
    image[:3] *= 0.84
    image[:, :3] *= 0.84
    return _clip(image)


def lino(size_m: float = 2.0, n: int = 512) -> Image:
    """Marbled linoleum, pale olive, one piece."""
    del size_m
    rng = np.random.default_rng(16)
    flow = 0.030 * _noise(rng, n, 18.0, 3.0) + 0.018 * _noise(rng, n, 3.0, 1.0)
    base = np.array([0.66, 0.655, 0.56], dtype=np.float32)
    return _clip(base * (1.0 + flow[..., None]))


def tiles(size_m: float = 1.2, n: int = 384) -> Image:
    """Blue-grey ceramic tiles of 0.3 m, each of its own tone, pale joints."""
    rng = np.random.default_rng(17)
    count = round(size_m / 0.3)
    step = n // count
    image = np.empty((n, n, 3), dtype=np.float32)
    for i in range(count):
        for j in range(count):
            tone = float(rng.normal(1.0, 0.035))
            image[i * step : (i + 1) * step, j * step : (j + 1) * step] = tone
    image *= np.array([0.60, 0.68, 0.71], dtype=np.float32)
    image *= (1.0 + 0.015 * _noise(rng, n, 4.0, 4.0))[..., None]
    for line in range(0, n, step):
        image[line : line + 3] = 0.80
        image[:, line : line + 3] = 0.80
    return _clip(image)


PAINTERS = {
    "floor_planks": (planks, 4.0),
    "floor_carpet": (carpet, 2.0),
    "floor_felt": (felt, 2.0),
    "floor_vinyl": (vinyl, 1.2),
    "floor_concrete": (concrete, 6.0),
    "floor_lino": (lino, 2.0),
    "floor_tiles": (tiles, 1.2),
}


@cache
def floor(material: str) -> tuple[bytes, int, float]:
    """RGB bytes, width = height px and edge m of one floor material's tile."""
    painter, size_m = PAINTERS[material]
    image = painter(size_m)
    return (image * 255.0 + 0.5).astype(np.uint8).tobytes(), image.shape[0], size_m


def _cuts(rng: np.random.Generator, n: int, shortest: int, longest: int) -> list[int]:
    """0 = first < ... < last = n, no piece shorter than ``shortest``."""
    cuts = [0]
    while n - cuts[-1] > longest:
        cuts.append(min(cuts[-1] + int(rng.integers(shortest, longest)), n - shortest))
    return [*cuts, n]


def _clip(image: NDArray[np.floating[Any]]) -> Image:
    return np.asarray(np.clip(image, 0.0, 1.0), dtype=np.float32)


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
CLOTH = "fabric_blue"  # of a part that can be upholstered
UPHOLSTERY = (CLOTH, CLOTH, CLOTH, "fabric_teal", "fabric_slate")


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
    """Fabric of one chair."""
    return {CLOTH: str(rng.choice(UPHOLSTERY))}


def paint_floors(spec: mujoco.MjSpec, more: Sequence[str] = ()) -> None:
    """Give the floor materials in use, and ``more``, their textures."""
    used = {geom.material for geom in spec.geoms} | set(more)
    for material in sorted(used & PAINTERS.keys()):
        data, n, size_m = floor(material)
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
        quat, top = quaternion(yaw_of(wall)), z + c
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

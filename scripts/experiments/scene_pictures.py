# SPDX-License-Identifier: Apache-2.0
"""One picture of each scene for docs/scenes.md.

``python -m scripts.experiments.scene_pictures``.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import mujoco
from PIL import Image

import scenes
from sim.view import gl
from sim.view.camera import Camera
from slam.files import replacing

SIZE = (960, 540)
OVERSAMPLING = 2  # drawn larger, then averaged: cleaner thin legs
MAX_BYTES = 250_000  # of a picture kept in docs/
SEED = 3


def draw(name: str, seed: int, view: str) -> Image.Image:
    """A scene as it starts."""
    scene = scenes.build(name, seed)
    model = scene.compile()
    data = mujoco.MjData(model)
    scene.place(model, data)
    mujoco.mj_forward(model, data)
    width, height = (OVERSAMPLING * side for side in SIZE)
    with Camera(model, width, height, samples=4) as camera:
        large = camera.render(data, view)
    return Image.fromarray(large).resize(SIZE, Image.Resampling.LANCZOS)


def save(picture: Image.Image, path: Path) -> int:
    """Write a PNG of 256 colours, spread so that the few plants keep their green; its bytes."""
    small = picture.quantize(
        256, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE
    )
    with replacing(path) as temporary:
        small.save(temporary, format="PNG", optimize=True)
    return path.stat().st_size


def main(arguments: list[str] | None = None) -> int:
    """Draw the scenes asked for, all by default; 1 where there is no OpenGL."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=scenes.names())
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--view", default="persp", choices=("persp", "top", "follow"))
    wanted = parser.parse_args(arguments)
    found = gl.find()
    if found.backend is None:
        print(f"No pictures drawn: {found.reason}. They need OpenGL (EGL or OSMesa).")
        return 1
    wanted.out.mkdir(parents=True, exist_ok=True)
    for name in wanted.scenes or scenes.names():
        path = wanted.out / f"scene_{name}.png"
        size = save(draw(name, wanted.seed, wanted.view), path)
        print(f"{path}  {size / 1000:.0f} kB" + ("  too big" if size > MAX_BYTES else ""))
    return 0


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""Every kind of furniture in one picture, each with its name."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

import scenes
from scenes.kinds import KINDS, PUSHED
from scenes.plan import furniture
from scripts.scene.picture import Picture
from sim.view.mapview import MapView

COLUMNS, STEP_M = 7, 4.2
PX = 1400
FONT = cv2.FONT_HERSHEY_SIMPLEX


def kinds() -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of what stands and of what can be pushed, which ``put`` takes."""
    return furniture(), tuple(k for k, row in KINDS.items() if row.group in PUSHED)


def picture() -> Picture:
    """(height, width, 3) RGB, from above."""
    names = sorted(sum(kinds(), ()))
    rows = -(-len(names) // COLUMNS)
    spots = {
        name: ((k % COLUMNS + 0.5) * STEP_M, (rows - k // COLUMNS - 0.5) * STEP_M)
        for k, name in enumerate(names)
    }
    wide, high = COLUMNS * STEP_M, rows * STEP_M
    put = "\n".join(f'  ["{name}", {x:.2f}, {y + 0.3:.2f}, 0],' for name, (x, y) in spots.items())
    outline = f"[[0, -2], [{wide}, -2], [{wide}, {high}], [0, {high}], [0, -2]]"
    with TemporaryDirectory() as folder:
        file = Path(folder) / "kinds.toml"
        file.write_text(
            f"walls = [{outline}]\nstart = [1, -1, 0]\nseats = false\nput = [\n{put}\n]\n",
            encoding="utf-8",
        )
        scene = scenes.build(str(file))
    view = MapView(scene, PX, round(PX * (high + 3.2) / (wide + 1.2)))
    drawn = view.draw([scene.initial[mover.name] for mover in scene.movers])
    for name, (x, y) in spots.items():
        (width, _), _ = cv2.getTextSize(name, FONT, 0.48, 1)
        at = view.to_pixels(np.array([[x, y - 0.46 * STEP_M]]))[0]
        place = (round(at[0] - 0.5 * width), round(at[1]))
        cv2.putText(drawn, name, place, FONT, 0.48, (40, 44, 54), 1, cv2.LINE_AA)
    return drawn[: round(view.to_pixels(np.array([[0.0, -0.3]]))[0][1])]

# SPDX-License-Identifier: Apache-2.0
"""A film as a picture that moves: the panes in their places, four times as fast."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scripts.film.encode import SIZE, Size, film
from scripts.film.loop import HEIGHT, PICTURE_MS, SPEED, WIDTH, main
from scripts.film.panes import Layout

pytestmark = pytest.mark.film
FPS, RED, BLUE = 8.0, (250, 0, 0), (0, 0, 250)


def filmed(folder: Path, size: Size, seconds: float) -> Path:
    """A film whose camera pane is red and whose map is blue, with a corner that changes."""
    layout, picture = Layout.of(size, camera=True), np.zeros((size[1], size[0], 3), np.uint8)
    assert layout.camera is not None
    for box, color in ((layout.camera, RED), (layout.map, BLUE)):
        picture[box.y : box.y + box.height, box.x : box.x + box.width] = color
    with film(folder / "film.mp4", FPS) as reel:
        for k in range(round(seconds * FPS)):
            picture[layout.map.y :, layout.map.x :][:90, :90] = 15 * k
            reel.add(picture)
    return folder


def test_the_panes_of_a_film_move_on_a_page(tmp_path: Path):
    out = tmp_path / "page.webp"
    assert main([str(filmed(tmp_path, SIZE, 2.0)), str(out)]) == 0
    with Image.open(out) as moving:
        assert (moving.size, moving.info["loop"], moving.format) == ((WIDTH, HEIGHT), 0, "WEBP")
        assert moving.n_frames == 2.0 / SPEED / (PICTURE_MS / 1e3)
        seen = np.asarray(moving.convert("RGB")).astype(int)
    for (x, y), color in (((720, 110), RED), ((260, 170), BLUE)):
        assert np.abs(seen[y, x] - color).max() < 30

# SPDX-License-Identifier: Apache-2.0
"""Maps of map_server."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image

from scenes.from_map import plan
from slam.estimate import Raster
from slam.maps import read_map
from tests.scripts.kinds.kind import Kind

GRAYS = np.full((60, 80), 254, dtype=np.uint8)
GRAYS[:2], GRAYS[-2:], GRAYS[:, :2], GRAYS[:, -2:], GRAYS[:40, 50] = 0, 0, 0, 0, 0
FLOW, BLOCK = "origin: [-1.5, -2, 0.25]\n", "origin:\n- -1.5\n- -2\n- 0.25\n"
FIELDS = "image: a.png\nresolution: 0.1\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


def _write(folder: Path, text: str, image: str = "a.png", pixels: np.ndarray = GRAYS) -> Path:
    Image.fromarray(pixels).save(folder / image)
    path = folder / "map.yaml"
    path.write_bytes(text.replace("a.png", image).encode("utf-8"))
    return path


def _as_text(folder: Path) -> Path:
    """The image as numbers in words."""
    words = "\n".join(" ".join(map(str, row)) for row in GRAYS.tolist())
    path = _write(folder, FIELDS + FLOW).with_name("a.pgm")
    path.write_text(f"P2\n80 60\n255\n{words}\n")
    (folder / "map.yaml").write_text((FIELDS + FLOW).replace("a.png", "a.pgm"))
    return folder / "map.yaml"


def _read(path: Path, _: bool) -> tuple[str, Raster]:
    return "", read_map(path)


def _planned(path: Path, _: bool) -> None:
    plan(read_map(path), source=path.name)


def _is_the_map(raster: Raster) -> None:
    np.testing.assert_array_equal(raster.values, (GRAYS[::-1] == 0).astype(np.float32))
    assert raster.T_map_origin.tolist() == [-1.5, -2.0, 0.25]


def _read_as(name: str, write: Callable[[Path], Path], done: str = "", said: str = "") -> Kind:
    done = done or "read as any other"
    return Kind(name=name, done=done, said=said, write=write, read=_read, check=_is_the_map)


def _refused(name: str, said: str, write: Callable[[Path], Path], read: object = _read) -> Kind:
    return Kind(name=name, done="refused", said=said, write=write, read=read, check=None)


EQUAL, CROSSED = (
    FIELDS.replace("0.65", high).replace("0.196", "0.5") + FLOW for high in ("0.5", "0.3")
)
JSON = "\ufeff{" + (FIELDS + FLOW).strip().replace("\n", ",\r\n\t") + "}"
MUCH = "origin: " + "[" * 30_000
NARROW = np.where(np.arange(80) % 5 == 0, 0, GRAYS).astype(np.uint8)
KINDS = [
    _read_as("map.yaml: a list in lines with `-`", partial(_write, text=FIELDS + BLOCK)),
    _read_as("map.yaml: JSON, tabs, line ends and mark of Windows", partial(_write, text=JSON)),
    _read_as(
        "map.yaml: equal thresholds", partial(_write, text=EQUAL), "above is occupied, below free"
    ),
    _read_as(
        "map.yaml: crossed thresholds", partial(_write, text=CROSSED),
        "what is between is occupied", "free_thresh … lies above occupied_thresh …",
    ),
    _read_as("the image of a map: BMP", partial(_write, text=FIELDS + FLOW, image="a.bmp")),
    _read_as("the image of a map: TIFF", partial(_write, text=FIELDS + FLOW, image="a.tif")),
    _read_as("the image of a map: PGM in words (P2)", _as_text),
    _read_as(
        "the image of a map: 16 bits",
        partial(_write, text=FIELDS + FLOW, pixels=GRAYS.astype(np.uint16) * 257),
        "rounded to 8",
    ),
    _refused(
        "the image of a map: another kind",
        "expected PGM, PNG, BMP, TIFF or JPEG of 8 or 16 bits; an image editor saves it as PNG",
        partial(_write, text=FIELDS + FLOW, image="a.gif"),
    ),
    _refused(
        "map.yaml: one field twice", "it has 'negate' twice",
        partial(_write, text=FIELDS + FLOW + "negate: 1\n"),
    ),
    _refused(
        "map.yaml: no YAML, or nested without end", "is no YAML: …", partial(_write, text=MUCH)
    ),
    _refused(
        "a map where the robot of `scene from-map` has no room",
        "a robot of 0.26 m radius, 0.1 m from all walls,",
        partial(_write, text=FIELDS + FLOW, pixels=NARROW), _planned,
    ),
]  # fmt: skip

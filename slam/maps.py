# SPDX-License-Identifier: Apache-2.0
"""Maps as files: PGM + YAML as the map_server of ROS 1 and nav2 loads them, and as a picture."""

import hashlib
import logging
import os
import re
import shutil
from pathlib import Path

import numpy as np

from slam import inputs
from slam.arrays import Bools, Bytes, Float32
from slam.bounded import bytes_of, text_of, yaml_in
from slam.errors import InvalidValueError, LogFormatError
from slam.estimate import Raster
from slam.files import part_of, put, replacing, sync, sync_names, unfinished
from slam.map_image import MAX_HEADER_BYTES, pixels_of

_log = logging.getLogger(__name__)

OCCUPIED_THRESHOLD = 0.65
# ROS 1's value. nav2's map_saver writes 0.25, with which a map_server takes the unknown gray 205
# (1 - 205/255 = 0.19608) for free; 0.196 keeps it unknown in both.
FREE_THRESHOLD = 0.196
OCCUPIED, UNKNOWN, FREE = 0, 205, 254

MODES = ("trinary", "scale", "raw")
Fields = dict[str, str | list[str | None] | None]
_YES, _NO = ("1", "true", "yes", "on"), ("0", "false", "no", "off")

MAX_PIXELS = 1 << 28  # 490 m square at 3 cm cells
MAX_CELL_M, MIN_CELL_M = 1e3, 1e-4  # edge of a cell
MAX_ORIGIN = 1e8  # m, rad; beyond, a float has no room for cells
_MAX_YAML_BYTES = 1 << 16
_EDITED = ": the sum differs (after a change on purpose, delete the two lines of sums in the YAML)"
_IMAGE_SUM, _FIELDS_SUM = "sha256 of the image:", "sha256 of the lines below:"
_SUMS = re.compile(rf"# {_IMAGE_SUM} ([0-9a-f]{{64}})\n# {_FIELDS_SUM} ([0-9a-f]{{64}})\n")
_OF_SUMS = re.compile(rf"{_IMAGE_SUM}|{_FIELDS_SUM}|\b[0-9a-f]{{64}}\b")  # what is left of damaged


def write_map(stem: Path, raster: Raster) -> tuple[Path, Path]:
    """``<stem>.pgm`` and ``<stem>.yaml``; returns the two paths.

    Values above 0.65 are occupied (black), below 0.196 free, all between and NaN unknown: what a
    map_server in "trinary" mode makes of them. Two comments at the head of the YAML, which a
    map_server skips, hold sums of the image and of the fields, for ``read_map``. Raises
    ``OutputError`` when they cannot be written and ``InvalidValueError`` for a map without cells or
    with more than ``MAX_PIXELS``.
    """
    _check_cells(raster.values.size, raster.values.shape)
    pgm, yaml = stem.with_name(stem.name + ".pgm"), stem.with_name(stem.name + ".yaml")
    x, y, yaw = raster.T_map_origin.tolist()
    lines = [
        f"image: {pgm.name}",
        "mode: trinary",
        f"resolution: {_plain(raster.resolution_m)}",
        f"origin: [{_plain(x)}, {_plain(y)}, {_plain(yaw)}]",
        "negate: 0",
        f"occupied_thresh: {OCCUPIED_THRESHOLD}",
        f"free_thresh: {FREE_THRESHOLD}",
    ]
    fields = "\n".join(lines) + "\n"
    with replacing(yaml) as new_yaml, replacing(pgm) as new_pgm:  # the image is in place first
        image_sum = _write_pgm(new_pgm, raster)
        sums = f"# {_IMAGE_SUM} {image_sum}\n# {_FIELDS_SUM} {_sha256(fields.encode())}\n"
        new_yaml.write_text(sums + fields, encoding="utf-8")
        _keep_earlier(yaml, pgm)
    _kept(pgm).unlink(missing_ok=True)
    return pgm, yaml


def _write_pgm(path: Path, raster: Raster) -> str:
    """Write the image, highest y first; its sum."""
    height, width = raster.values.shape
    gray = np.full((height, width), UNKNOWN, np.uint8)
    np.copyto(gray, OCCUPIED, where=raster.values > OCCUPIED_THRESHOLD)  # false for NaN
    np.copyto(gray, FREE, where=raster.values < FREE_THRESHOLD)
    header, pixels = f"P5\n{width} {height}\n255\n".encode("ascii"), gray[::-1].tobytes()
    with path.open("wb") as file:
        file.write(header)
        file.write(pixels)
    digest = hashlib.sha256(header)
    digest.update(pixels)
    return digest.hexdigest()


def _keep_earlier(yaml: Path, pgm: Path) -> None:
    """Let the YAML file of an earlier map name a second link to its image, which stays when ``pgm``
    is replaced: a power cut between the two files leaves the earlier map, not half of each."""
    try:
        text = yaml.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return  # none, or none that could be read
    line, kept = f"image: {pgm.name}\n", _kept(pgm)
    if line not in text or unfinished(pgm) or not pgm.is_file():
        return
    kept.unlink(missing_ok=True)
    try:
        os.link(pgm, kept)
    except OSError:  # a file system without links
        shutil.copyfile(pgm, kept)
        sync(kept)
    sync_names(pgm.parent)
    part = part_of(kept.with_suffix(".yaml"))
    try:
        part.write_text(text.replace(line, f"image: {kept.name}\n"), encoding="utf-8")
        put(part, yaml)
    finally:
        part.unlink(missing_ok=True)


def _kept(pgm: Path) -> Path:
    return pgm.with_name(f".{pgm.stem}.earlier.pgm")


def read_map(yaml: Path, *, saved: bool = False, most_pixels: int = MAX_PIXELS) -> Raster:
    """The raster of a map_server YAML file: 1 occupied, 0 free, NaN unknown.

    Reads any YAML, and images as ``slam.map_image`` does, in the modes trinary, scale (between the
    thresholds in proportion) and raw (0 to 100). What is above ``occupied_thresh`` is occupied,
    else below ``free_thresh`` free, else unknown; a warning says where the two are crossed. Raises
    ``LogFormatError`` naming the file when one of the two is missing, wrong, too large, or not what
    the sums of ``write_map`` say; files without these sums are read as they are.

    most_pixels  of the image
    saved  take the gray 205, which every map_saver writes for unknown, for unknown, though nav2's
           own threshold of 0.25 makes a map_server take it for free
    """
    if yaml.suffix.lower() in (".pgm", ".png"):
        raise LogFormatError(yaml, "is an image, expected the YAML file that names it")
    text = text_of(yaml, _MAX_YAML_BYTES)
    image_sum = _checked_sums(yaml, text)
    fields = yaml_in(yaml, text, "map of map_server")
    resolution = _numbers(yaml, fields, "resolution", 1, MIN_CELL_M, MAX_CELL_M)[0]
    origin = _numbers(yaml, fields, "origin", 3, -MAX_ORIGIN, MAX_ORIGIN)
    mode = _word(yaml, fields, "mode", "trinary").lower()
    if mode not in MODES:
        raise LogFormatError(yaml, f"mode must be one of {', '.join(MODES)}, got {_said(mode)}")
    gray, opaque = _read_image(yaml.parent / _word(yaml, fields, "image"), image_sum, most_pixels)
    meant = _meaning(yaml, fields, mode)
    if saved and mode != "raw":
        meant[UNKNOWN] = np.nan
    values = meant[gray[::-1]]
    if opaque is not None:
        values[~opaque[::-1]] = np.nan
    try:
        return Raster(values=values, resolution_m=resolution, T_map_origin=np.array(origin))
    except InvalidValueError as error:
        raise LogFormatError(yaml, str(error)) from error


def _meaning(yaml: Path, fields: Fields, mode: str) -> Float32:
    """Of each gray: (256,) how likely it is occupied, NaN for unknown."""
    grays = np.arange(256)
    if mode == "raw":
        return np.where(grays <= 100, grays / 100.0, np.nan).astype(np.float32)
    negate = _word(yaml, fields, "negate", "0").lower()
    if negate not in (*_YES, *_NO):
        raise LogFormatError(yaml, f"negate must be 0 or 1, got {_said(negate)}")
    occupancy = grays / 255.0 if negate in _YES else (255 - grays) / 255.0
    high = _numbers(yaml, fields, "occupied_thresh", 1, -100.0, 100.0)[0]
    low = _numbers(yaml, fields, "free_thresh", 1, -100.0, 100.0)[0]
    if low > high:
        _log.warning(
            "%s: free_thresh %g lies above occupied_thresh %g: what is between is occupied",
            yaml, low, high,
        )  # fmt: skip
    scale = mode == "scale" and low < high
    between = (occupancy - low) / (high - low) if scale else np.nan
    meant = np.where(occupancy > high, 1.0, np.where(occupancy < low, 0.0, between))
    return meant.astype(np.float32)


def _check_cells(count: int, shape: tuple[int, ...]) -> None:
    if not 0 < count <= MAX_PIXELS:
        raise InvalidValueError(f"a map file needs 1 to {MAX_PIXELS} cells, got shape {shape}")


def _plain(value: float) -> str:
    """Shortest digits that read back the same, never like 1e-05, which YAML 1.1 takes for text."""
    return np.format_float_positional(value, trim="0")


def _word(yaml: Path, fields: Fields, key: str, otherwise: str = "") -> str:
    value = fields.get(key, otherwise)
    if value == "":
        value = otherwise
    if value == "":
        raise LogFormatError(yaml, f"has no {key}, which a map_server needs")
    if not isinstance(value, str):
        raise LogFormatError(yaml, f"{key} must be one value, got {_said(value)}")
    return value.strip()


def _numbers(
    yaml: Path, fields: Fields, key: str, count: int, low: float, high: float
) -> list[float]:
    given = fields.get(key)
    if isinstance(given, list):
        words = [word or "" for word in given]
    else:
        words = _word(yaml, fields, key).strip("[]").split(",")  # a list in quotes
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if len(values) != count or not all(low <= value <= high for value in values):
        what = "a number" if count == 1 else f"{count} numbers"
        got = _said(fields[key])
        raise LogFormatError(yaml, f"{key} must be {what} from {low:g} to {high:g}, got {got}")
    return values


def _said(value: str | list[str | None] | None) -> str:
    """A field's value for a message."""
    if isinstance(value, list):
        value = f"[{', '.join(word or 'a list or fields' for word in value[:9])}]"
    return value[:80] if value is not None else "fields"


def has_sums(yaml: Path) -> bool:
    """Whether the map holds the sums that ``write_map`` notes, which ``read_map`` checks."""
    return _checked_sums(yaml, text_of(yaml, _MAX_YAML_BYTES)) is not None


def _checked_sums(yaml: Path, text: str) -> str | None:
    """The image's sum that ``write_map`` noted, None where there is none; checks the fields'."""
    found = _SUMS.match(text)
    if found is None:
        if _OF_SUMS.search(text):
            raise LogFormatError(yaml, f"its sums are not those that were written{_EDITED}")
        return None
    if found[2] != _sha256(text[found.end() :].encode()):
        raise LogFormatError(yaml, f"its fields are not those that were written{_EDITED}")
    return found[1]


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _read_image(path: Path, image_sum: str | None, most: int) -> tuple[Bytes, Bools | None]:
    """Gray values, and which pixels are opaque where the image says so."""
    data = bytes_of(path, most + MAX_HEADER_BYTES)
    inputs.note(path)
    if image_sum is not None and _sha256(data) != image_sum:
        raise LogFormatError(path, f"is not the image that was written{_EDITED}")
    return pixels_of(path, data, most)

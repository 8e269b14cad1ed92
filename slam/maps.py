# SPDX-License-Identifier: Apache-2.0
"""Maps as files: PGM + YAML as the map_server of ROS 1 and nav2 loads them, and as a picture."""

import hashlib
import os
import re
import shutil
import warnings
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam import inputs
from slam.arrays import Bools, Bytes, Float32
from slam.bounded import bytes_of, text_of
from slam.errors import InvalidValueError, LogFormatError
from slam.estimate import Raster
from slam.files import part_of, put, replacing, sync, sync_names, unfinished

OCCUPIED_THRESHOLD = 0.65
# ROS 1's value. nav2's map_saver writes 0.25, with which a map_server takes the unknown gray 205
# (1 - 205/255 = 0.19608) for free; 0.196 keeps it unknown in both.
FREE_THRESHOLD = 0.196
OCCUPIED, UNKNOWN, FREE = 0, 205, 254

MODES = ("trinary", "scale", "raw")

_UNKNOWN_RGB = (176, 180, 184)
_STOPS = np.array([0.0, 0.5, 1.0])  # of existence: free paper, doubtful amber, solid ink
_STOPS_RGB = np.array([[252, 250, 245], [233, 160, 76], [22, 33, 58]], dtype=np.float64)
_GAP = rb"\s+(?:#[^\n]*\n\s*)*"  # PGM allows comments between the words of its header
_PGM_HEADER = re.compile(rb"P5" + _GAP + rb"(\d+)" + _GAP + rb"(\d+)" + _GAP + rb"255\s")
_MAX_HEADER_BYTES = 4096
MAX_PIXELS = 1 << 28  # 490 m square at 3 cm cells
MAX_CELL_M, MIN_CELL_M = 1e3, 1e-4  # edge of a cell
MAX_ORIGIN = 1e8  # m, rad; beyond, a float has no room for cells
MAX_PNG_PIXELS = 178_956_970  # what Pillow unpacks, four bytes each
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

    Reads binary PGM and PNG images in the modes trinary, scale (between the thresholds in
    proportion) and raw (0 to 100). Raises ``LogFormatError`` naming the file when one of the two is
    missing, wrong, too large, or not what the sums of ``write_map`` say; files without these sums
    are read as they are.

    most_pixels  of the image
    saved  take the gray 205, which every map_saver writes for unknown, for unknown, though nav2's
           own threshold of 0.25 makes a map_server take it for free
    """
    text = text_of(yaml, _MAX_YAML_BYTES)
    image_sum = _checked_sums(yaml, text)
    fields = _yaml_fields(yaml, text)
    resolution = _numbers(yaml, fields, "resolution", 1, MIN_CELL_M, MAX_CELL_M)[0]
    origin = _numbers(yaml, fields, "origin", 3, -MAX_ORIGIN, MAX_ORIGIN)
    mode = fields.get("mode", "trinary")
    if mode not in MODES:
        raise LogFormatError(yaml, f"mode must be one of {', '.join(MODES)}, got {mode!r:.80}")
    gray, opaque = _read_image(yaml.parent / _field(yaml, fields, "image"), image_sum, most_pixels)
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


def _meaning(yaml: Path, fields: dict[str, str], mode: str) -> Float32:
    """Of each gray: (256,) how likely it is occupied, NaN for unknown."""
    grays = np.arange(256)
    if mode == "raw":
        return np.where(grays <= 100, grays / 100.0, np.nan).astype(np.float32)
    negate = fields.get("negate", "0").lower() in ("1", "true")
    occupancy = grays / 255.0 if negate else (255 - grays) / 255.0
    high = _numbers(yaml, fields, "occupied_thresh", 1, -100.0, 100.0)[0]
    low = _numbers(yaml, fields, "free_thresh", 1, -100.0, 100.0)[0]
    if not low < high:
        raise LogFormatError(yaml, f"free_thresh must be < occupied_thresh, got {low} and {high}")
    between = (occupancy - low) / (high - low) if mode == "scale" else np.nan
    meant = np.where(occupancy > high, 1.0, np.where(occupancy < low, 0.0, between))
    return meant.astype(np.float32)


def raster_image(raster: Raster) -> Bytes:
    """(height, width, 3) RGB picture, highest y on top: free light, solid dark, unknown gray."""
    values = raster.values[::-1].astype(np.float64)
    unknown = np.isnan(values)
    values[unknown] = 0.0
    channels = [np.interp(values, _STOPS, _STOPS_RGB[:, k]) for k in range(3)]
    image = np.round(np.stack(channels, axis=-1)).astype(np.uint8)
    image[unknown] = _UNKNOWN_RGB
    return image


def _check_cells(count: int, shape: tuple[int, ...]) -> None:
    if not 0 < count <= MAX_PIXELS:
        raise InvalidValueError(f"a map file needs 1 to {MAX_PIXELS} cells, got shape {shape}")


def _plain(value: float) -> str:
    """Shortest digits that read back the same, never like 1e-05, which YAML 1.1 takes for text."""
    return np.format_float_positional(value, trim="0")


def _yaml_fields(yaml: Path, text: str) -> dict[str, str]:
    """``key: value`` lines; a map_server file has no deeper structure but one bracketed list."""
    fields: dict[str, str] = {}
    for number, line in enumerate(text.splitlines(), 1):
        content = re.sub(r"(^|\s)#.*", "", line).strip()
        if not content or content == "---":
            continue
        key, colon, value = content.partition(":")
        if not colon:
            raise LogFormatError(yaml, f"expected 'key: value', got {content[:40]!r}", number)
        fields[key.strip()] = value.strip().strip("'\"")
    return fields


def _field(yaml: Path, fields: dict[str, str], key: str) -> str:
    if not fields.get(key):
        raise LogFormatError(yaml, f"has no {key}")
    return fields[key]


def _numbers(
    yaml: Path, fields: dict[str, str], key: str, count: int, low: float, high: float
) -> list[float]:
    text = _field(yaml, fields, key)
    try:
        values = [float(word) for word in text.strip("[]").split(",")]
    except ValueError as error:
        raise LogFormatError(yaml, f"{key}: {error}") from error
    if len(values) != count or not all(low <= value <= high for value in values):
        what = "a number" if count == 1 else f"{count} numbers"
        raise LogFormatError(yaml, f"{key} must be {what} from {low:g} to {high:g}, got {text:.80}")
    return values


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
    data = bytes_of(path, most + _MAX_HEADER_BYTES)
    inputs.note(path)
    if image_sum is not None and _sha256(data) != image_sum:
        raise LogFormatError(path, f"is not the image that was written{_EDITED}")
    if data.startswith(b"\x89PNG"):
        return _png(path, data, min(most, MAX_PNG_PIXELS))
    header = _PGM_HEADER.match(data[:_MAX_HEADER_BYTES])
    if header is None:
        raise LogFormatError(path, "no PNG, and not a binary PGM image of 8 bits (P5, maximum 255)")
    width, height = int(header[1][:9]), int(header[2][:9])
    pixels: NDArray[Any] = np.frombuffer(data, dtype=np.uint8, offset=header.end())
    if not 0 < width * height <= most or len(pixels) != width * height:
        raise LogFormatError(path, f"{width} x {height} pixels expected, found {len(pixels)}")
    return pixels.reshape(height, width), None


def _png(path: Path, data: bytes, most: int) -> tuple[Bytes, Bools | None]:
    """The mean of its colours, as a map_server takes it."""
    from PIL import Image, UnidentifiedImageError

    width, height = (int.from_bytes(data[at : at + 4], "big") for at in (16, 20))  # of its IHDR
    if data[12:16] == b"IHDR" and width * height > most:
        raise LogFormatError(
            path, f"{width} x {height} pixels, at most {most} are allowed in a PNG"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # half of that
            image = Image.open(BytesIO(data), formats=["PNG"])
        with image:
            if image.mode.startswith("I"):
                raise LogFormatError(path, "16 bits a pixel, expected 8")
            if image.mode == "P" and image.palette is None:
                raise LogFormatError(path, "no PNG that can be read: its palette is missing")
            clear = image.has_transparency_data
            pixels = np.asarray(image.convert("RGBA" if clear else "RGB"))
    except (  # ValueError: of its texts and of its lengths
        Image.DecompressionBombError, UnidentifiedImageError, OSError, SyntaxError, ValueError
    ) as error:  # fmt: skip
        raise LogFormatError(path, f"no PNG that can be read: {error}") from error
    gray = (pixels[..., :3].sum(axis=2, dtype=np.uint16) // 3).astype(np.uint8)
    return gray, pixels[..., 3] > 127 if clear else None

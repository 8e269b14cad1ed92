# SPDX-License-Identifier: Apache-2.0
"""The picture of a map: gray values of a PGM, PNG, BMP, TIFF or JPEG file."""

import re
import warnings
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slam.arrays import Bools, Bytes
from slam.errors import LogFormatError

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

_GAP = rb"\s+(?:#[^\n]*\n\s*)*"  # PGM allows comments between the words of its header
_PGM_HEADER = re.compile(rb"P5" + _GAP + rb"(\d+)" + _GAP + rb"(\d+)" + _GAP + rb"255\s")
MAX_HEADER_BYTES = 4096
MAX_PICTURE_PIXELS = 178_956_970  # what Pillow unpacks, four bytes each
_FORMATS = ("PNG", "PPM", "BMP", "TIFF", "JPEG")  # PPM: PBM, PGM and PPM, as bytes and as text
_CURE = "expected PGM, PNG, BMP, TIFF or JPEG of 8 or 16 bits; an image editor saves it as PNG"
_WHITE_IS_0 = {262: 0}  # a tag of TIFF, which Pillow heeds up to 8 bits


def pixels_of(path: Path, data: bytes, most: int) -> tuple[Bytes, Bools | None]:
    """(height, width) gray values, highest row first, and which are opaque if the image says so.

    Colours are their mean, and 16 bits the nearest 8, as a map_server takes them. Raises
    ``LogFormatError`` for what is no such image, damaged, or of more than ``most`` pixels.
    """
    header = _PGM_HEADER.match(data[:MAX_HEADER_BYTES])
    if header is None:
        return _decoded(path, data, min(most, MAX_PICTURE_PIXELS))
    width, height = int(header[1][:9]), int(header[2][:9])
    pixels: NDArray[Any] = np.frombuffer(data, dtype=np.uint8, offset=header.end())
    if not 0 < width * height <= most or len(pixels) != width * height:
        raise LogFormatError(path, f"{width} x {height} pixels expected, found {len(pixels)}")
    return pixels.reshape(height, width), None


def _decoded(path: Path, data: bytes, most: int) -> tuple[Bytes, Bools | None]:
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of large images, of odd tags
            with Image.open(BytesIO(data), formats=_FORMATS) as image:
                if image.width * image.height > most:
                    size = f"{image.width} x {image.height} pixels"
                    raise LogFormatError(path, f"{size}, at most {most} are allowed")
                return _gray(path, image)
    except UnidentifiedImageError:
        raise LogFormatError(path, f"damaged, or no image that is read: {_CURE}") from None
    except (LogFormatError, MemoryError):
        raise
    except Exception as error:  # decoders of others, on damaged bytes
        raise LogFormatError(path, f"an image that cannot be read: {error}") from error


def _gray(path: Path, image: "Picture") -> tuple[Bytes, Bools | None]:
    if image.mode.startswith("I;16") or (image.mode == "I" and image.format == "PPM"):
        deep = np.asarray(image).astype(np.int64)
        if image.format == "TIFF" and _WHITE_IS_0.items() <= dict(image.tag_v2).items():  # type: ignore[attr-defined]
            deep = 65535 - deep
        return ((deep + 128) // 257).astype(np.uint8), None
    if image.mode[0] in "IF":
        raise LogFormatError(path, f"32 bits a pixel, {_CURE}")
    if image.mode == "P" and image.palette is None:
        raise LogFormatError(path, "an image that cannot be read: its palette is missing")
    clear = image.has_transparency_data
    pixels = np.asarray(image.convert("RGBA" if clear else "RGB"))
    gray = (pixels[..., :3].sum(axis=2, dtype=np.uint16) // 3).astype(np.uint8)
    return gray, pixels[..., 3] > 127 if clear else None

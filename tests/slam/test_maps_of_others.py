# SPDX-License-Identifier: Apache-2.0
"""Maps as people write them: any YAML, any thresholds, the usual images."""

import json
import struct
import time

import numpy as np
import pytest
from PIL import Image

from slam import maps
from slam.errors import LogFormatError

GRAYS = np.array([[0, 100, 205, 254], [254, 0, 254, 130]], dtype=np.uint8)  # highest row first
MEANT = np.array([[0.0, 1.0, 0.0, np.nan], [1.0, np.nan, np.nan, 0.0]], dtype=np.float32)
ORIGIN = "origin: [-5.0, -4.0, 0.25]\n"
BARE = "image: room.png\nresolution: 0.05\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
FIELDS = {
    "image": "room.png", "resolution": 0.05, "origin": [-5.0, -4.0, 0.25], "negate": 0,
    "occupied_thresh": 0.65, "free_thresh": 0.196,
}  # fmt: skip
WRITTEN = {
    "block list": BARE + "origin:\n- -5.0\n- -4.0\n- 0.25\n",
    "list over lines": BARE + "origin: [-5.0,\n  -4.0, 0.25]\n",
    "list in quotes": BARE + 'origin: "[-5, -4, 0.25]"\n',
    "quoted keys": BARE.replace("resolution", '"resolution"')
    + ORIGIN.replace("origin", "'origin'"),
    "JSON": json.dumps(FIELDS),
    "JSON with tabs": json.dumps(FIELDS, indent="\t"),
    "flow without quotes": "{" + (BARE + ORIGIN).strip().replace("\n", ", ") + "}",
    "markers": "%YAML 1.2\n---\n" + BARE + ORIGIN + "...\n",
    "tabs and comments": "# a room\n"
    + (BARE + ORIGIN).replace(": ", ":\t").replace("\n", "\t# x\n"),
    "ends of Windows": (BARE + ORIGIN).replace("\n", "\r\n"),
    "anchors": BARE.replace("0.05", "&m 0.05") + ORIGIN + "spare: *m\n",
    "tags": BARE.replace("0.05", "!!float 0.05") + ORIGIN + "made: !!python/object:os.x {}\n",
    "folded": BARE.replace("room.png", ">-\n  room.png") + ORIGIN,
    "words for no": BARE.replace("negate: 0", "negate: No") + ORIGIN + "mode: Trinary\n",
}


@pytest.fixture
def room(tmp_path):
    Image.fromarray(GRAYS).save(tmp_path / "room.png")
    return tmp_path / "room.yaml"


@pytest.mark.parametrize("mark", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("text", WRITTEN.values(), ids=list(WRITTEN))
def test_any_yaml_of_a_map_is_the_same_map(room, text, mark):
    room.write_bytes(text.encode(mark))
    read = maps.read_map(room)
    np.testing.assert_array_equal(read.values, MEANT)
    assert read.T_map_origin.tolist() == [-5.0, -4.0, 0.25]
    assert read.resolution_m == 0.05


HOSTILE = {
    "deep": "origin: " + "[" * 60_000,
    "deep blocks": "- " * 30_000,
    "many": "origin: [" + "1," * 30_000,
    "aliases of aliases": "a0: &a0 [x, x]\n"
    + "".join(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 1500))
    + BARE
    + "origin: *a1499\n",
    "aliases, twice": "a0: &a0 [x, x]\n"
    + "".join(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 99))
    + "b: *a98\nb: *a98\n",
    "itself": BARE + "origin: &a [*a, *a, *a]\n",
    "aliases as a key": "a: &a [x]\nb: &b [*a, *a]\n? [*b, *b]\n: 1\n",
    "no such version": "%YAML 1.0\n---\n" + BARE,
    "no such letter": 'image: "\\UFFFFFFFF"\n',
    "many digits": BARE + "origin: [" + "9" * 60_000 + ", 0, 0]\n",
    "a control character": "image: a\x07\n",
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=list(HOSTILE))
def test_yaml_that_grows_or_nests_is_refused_in_one_short_line(room, text):
    room.write_text(text)
    begun = time.process_time()
    with pytest.raises(LogFormatError) as refused:
        maps.read_map(room)
    assert time.process_time() - begun < 60.0  # a growing one would never end
    assert len(str(refused.value)) < len(str(room)) + 400
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("high", "low", "means", "crossed"),
    [
        (0.5, 0.5, [1.0, 1.0, 0.0, 0.0], False),
        (0.3, 0.6, [1.0, 1.0, 0.0, 0.0], True),
        (1.0, 0.0, [np.nan] * 4, False),
        (0.196, 0.196, [1.0, 1.0, 1.0, 0.0], False),
    ],
)
@pytest.mark.parametrize("mode", ["trinary", "scale"])
def test_thresholds_may_be_equal_or_crossed(room, caplog, mode, high, low, means, crossed):
    fields = FIELDS | {"occupied_thresh": high, "free_thresh": low, "mode": mode}
    room.write_text(json.dumps(fields))
    read = maps.read_map(room).values[1]
    if not (mode == "scale" and low < high):
        np.testing.assert_array_equal(read, means)
    assert ("free_thresh 0.6 lies above occupied_thresh 0.3" in caplog.text) == crossed


def wide(image):
    """The same in 16 bits."""
    return np.asarray(image).astype(np.uint16) * 257


def p2(path):
    path.write_text("P2\n# by hand\n4 2\n255\n" + "\n".join(" ".join(map(str, r)) for r in GRAYS))


def p5_of_16_bits(path):
    path.write_bytes(b"P5 4 2 65535\n" + wide(GRAYS).astype(">u2").tobytes())


def tiff_of_16_bits_whose_0_is_white(path):
    data = (65535 - wide(GRAYS)).astype("<u2").tobytes()
    tags = [(256, 4), (257, 2), (258, 16), (259, 1), (262, 0), (273, 8), (277, 1), (278, 2)]
    tags.append((279, len(data)))
    rows = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
    header = struct.pack("<2sHI", b"II", 42, 8 + len(data))
    path.write_bytes(header + data + struct.pack("<H", len(tags)) + rows + bytes(4))


IMAGES = {
    "a.pgm": p2,
    "b.pgm": p5_of_16_bits,
    "c.pgm": lambda path: path.write_bytes(b"P5 4 2 255 " + GRAYS.tobytes()),
    "d.ppm": lambda path: Image.fromarray(GRAYS).convert("RGB").save(path),
    "e.bmp": lambda path: Image.fromarray(GRAYS).save(path),
    "g.tiff": lambda path: Image.fromarray(GRAYS).save(path),
    "i.tif": lambda path: Image.fromarray(wide(GRAYS)).save(path),
    "j.tif": tiff_of_16_bits_whose_0_is_white,
    "k.png": lambda path: Image.fromarray(wide(GRAYS)).save(path),
    "l.png": lambda path: Image.fromarray(GRAYS).convert("P").save(path),
    "m.jpg": lambda path: Image.fromarray(np.kron(GRAYS, np.ones((8, 8), np.uint8))).save(path),
}


@pytest.mark.parametrize("name", IMAGES)
def test_the_usual_images_are_the_same_map(room, name):
    IMAGES[name](room.with_name(name))
    room.write_text((BARE + ORIGIN).replace("room.png", name))
    values = maps.read_map(room).values
    if name == "m.jpg":
        values = values[4::8, 4::8]
    np.testing.assert_array_equal(values, MEANT)


@pytest.mark.parametrize(
    ("name", "save", "said"),
    [
        ("a.gif", lambda path: Image.fromarray(GRAYS).save(path), "expected PGM, PNG, BMP, TIFF"),
        ("a.svg", lambda path: path.write_text("<svg/>"), "an image editor saves it as PNG"),
        ("a.tif", lambda path: Image.fromarray(GRAYS.astype("f4")).save(path), "32 bits a pixel"),
        ("a.pgm", lambda path: path.write_text("P2 4 2 255 0 0 0"), "cannot be read: not enough"),
        ("b.pgm", lambda path: path.write_bytes(b"P5 4 2 65535 \0\0"), "cannot be read"),
        (
            "c.pgm",
            lambda path: path.write_text("P2 9000 9000 255 0"),
            "9000 x 9000 pixels, at most",
        ),
        ("a.bmp", lambda path: path.write_bytes(b"BM" + bytes(60)), "an image that cannot be read"),
    ],
)
def test_another_image_is_refused_with_the_cure(room, name, save, said):
    save(room.with_name(name))
    room.write_text((BARE + ORIGIN).replace("room.png", name))
    with pytest.raises(LogFormatError, match=said):
        maps.read_map(room, most_pixels=10_000_000)

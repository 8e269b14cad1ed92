# SPDX-License-Identifier: Apache-2.0
"""Map files: what ROS loads is what was meant."""

import hashlib
import os
import zlib
from contextlib import suppress

import cv2
import numpy as np
import pytest
from PIL import Image

from slam import Raster, maps
from slam.errors import InvalidValueError, LogFormatError, OutputError


def small_map():
    """3 rows of 4: the lowest row is free, a wall on top, unknown between."""
    values = np.array(
        [[0.0, 0.1, 0.0, 0.19], [np.nan, 0.2, 0.5, 0.65], [1.0, 0.66, 0.9, 1.0]], dtype=np.float32
    )
    return Raster(values=values, resolution_m=0.05, T_map_origin=[-1.5, 1e-5, 0.25])


def test_the_image_has_the_highest_row_first_and_the_three_grays(tmp_path):
    pgm, yaml = maps.write_map(tmp_path / "map", small_map())
    data = pgm.read_bytes()
    assert data.startswith(b"P5\n4 3\n255\n")
    assert list(data[-12:]) == [0, 0, 0, 0, 205, 205, 205, 205, 254, 254, 254, 254]
    assert cv2.imread(str(pgm), cv2.IMREAD_UNCHANGED).shape == (3, 4)
    sums = [hashlib.sha256(pgm.read_bytes()).hexdigest()]
    sums.append(hashlib.sha256(yaml.read_bytes().split(b"\n", 2)[2]).hexdigest())
    assert yaml.read_text().splitlines() == [
        f"# sha256 of the image: {sums[0]}",
        f"# sha256 of the lines below: {sums[1]}",
        "image: map.pgm",
        "mode: trinary",
        "resolution: 0.05",
        "origin: [-1.5, 0.00001, 0.25]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.196",
    ]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.pgm", "map.yaml"]


def test_map_server_reads_the_three_grays_as_they_were_meant():
    def cell(gray):
        """The rule of both map_servers, mode trinary, negate 0."""
        occupancy = (255 - gray) / 255.0
        if occupancy > maps.OCCUPIED_THRESHOLD:
            return 100
        return 0 if occupancy < maps.FREE_THRESHOLD else -1

    assert [cell(g) for g in (maps.OCCUPIED, maps.UNKNOWN, maps.FREE)] == [100, -1, 0]


def test_round_trip(tmp_path):
    raster = small_map()
    _, yaml = maps.write_map(tmp_path / "rooms.v2", raster)
    assert yaml.name == "rooms.v2.yaml"
    back = maps.read_map(yaml)
    expected = np.array([[0.0] * 4, [np.nan] * 4, [1.0] * 4])
    np.testing.assert_array_equal(back.values, expected)
    np.testing.assert_array_equal(back.T_map_origin, raster.T_map_origin)
    assert back.resolution_m == raster.resolution_m
    maps.write_map(tmp_path / "again", back)
    assert (tmp_path / "again.pgm").read_bytes() == (tmp_path / "rooms.v2.pgm").read_bytes()


def test_maps_of_other_writers(tmp_path):
    (tmp_path / "a.pgm").write_bytes(b"P5\n# CREATOR: map_saver 0.05 m/pix\n2 1\n255\n\x00\xfe")
    (tmp_path / "a.yaml").write_text(
        "---\nimage: 'a.pgm'  # the picture\nresolution: 5e-2\norigin: [1, 2, 0]\n"
        "negate: false\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    back = maps.read_map(tmp_path / "a.yaml")
    np.testing.assert_array_equal(back.values, [[1.0, 0.0]])
    (tmp_path / "a.yaml").write_text(
        (tmp_path / "a.yaml").read_text().replace("negate: false", "negate: 1")
    )
    np.testing.assert_array_equal(maps.read_map(tmp_path / "a.yaml").values, [[0.0, 1.0]])


def without_sums(yaml):
    """The file as other writers make it."""
    yaml.write_text(yaml.read_text().split("\n", 2)[2])


def test_a_damaged_line_of_sums_is_told_and_not_taken_for_none(tmp_path):
    """Each byte of the two lines flipped, cut out and made a blank; each line cut out."""
    _, yaml = maps.write_map(tmp_path / "map", small_map())
    whole = yaml.read_bytes()
    first = whole.index(b"\n") + 1
    end = whole.index(b"\n", first) + 1
    damaged = [whole[first:], whole[:first] + whole[end:]]
    for k in range(end):
        for instead in (bytes([whole[k] ^ 1 << k % 8]), b"", b" "):
            damaged.append(whole[:k] + instead + whole[k + 1 :])
    for data in damaged:
        yaml.write_bytes(data)
        if data != whole:
            with pytest.raises(LogFormatError, match=r"written|not a text file"):
                maps.read_map(yaml)
            with suppress(LogFormatError):
                assert maps.has_sums(yaml)


def test_a_file_claims_no_more_than_a_map_can_have(tmp_path):
    pgm, yaml = maps.write_map(tmp_path / "map", small_map())
    without_sums(yaml)
    pgm.write_bytes(b"P5\n1000000 1000000\n255\n" + bytes(12))
    with pytest.raises(LogFormatError, match="1000000 x 1000000 pixels expected, found 12"):
        maps.read_map(yaml)
    with pgm.open("wb") as file:
        file.truncate(1 << 30)  # a hole: no bytes on the disk
    with pytest.raises(LogFormatError, match=r"map\.pgm: has 1073741824 bytes; at most"):
        maps.read_map(yaml)
    pgm.unlink()
    os.mkfifo(pgm)
    with pytest.raises(LogFormatError, match=r"map\.pgm: cannot be read: not a file"):
        maps.read_map(yaml)
    yaml.write_bytes(b"image: a.pgm\n" * 10_000)
    with pytest.raises(LogFormatError, match=r"map\.yaml: has 130000 bytes"):
        maps.read_map(yaml)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("image: map.pgm", "image: gone.pgm", "gone.pgm: cannot be read"),
        ("image: map.pgm", "image: map.yaml", "no image that is read: expected PGM, PNG"),
        ("resolution: 0.05\n", "", "has no resolution"),
        ("resolution: 0.05", "resolution: fine", "resolution must be a number .*, got fine"),
        ("resolution: 0.05", "resolution: nan", "resolution must be a number from 0.0001"),
        ("origin: [", "origin: [7, ", "origin must be 3 numbers from -1e.08 to 1e.08"),
        ("mode: trinary", "mode: rough", "mode must be one of trinary, scale, raw"),
        ("image: map.pgm", 'image: "C:\\map.pgm"', "is no YAML: .* unknown escape"),
        ("negate: 0", "...\n---\nnegate: 0", "is no YAML: expected a single document"),
    ],
)
def test_damaged_maps_are_refused(tmp_path, old, new, match):
    _, yaml = maps.write_map(tmp_path / "map", small_map())
    without_sums(yaml)
    yaml.write_text(yaml.read_text().replace(old, new))
    with pytest.raises(LogFormatError, match=match):
        maps.read_map(yaml)


def test_missing_and_truncated_files_are_refused(tmp_path):
    with pytest.raises(LogFormatError, match="cannot be read"):
        maps.read_map(tmp_path / "none.yaml")
    pgm, yaml = maps.write_map(tmp_path / "map", small_map())
    without_sums(yaml)
    pgm.write_bytes(pgm.read_bytes()[:-1])
    with pytest.raises(LogFormatError, match="4 x 3 pixels expected, found 11"):
        maps.read_map(yaml)
    pgm.write_bytes(b"P5" + b" " * 100_000 + b"x")
    with pytest.raises(LogFormatError, match="an image that cannot be read"):
        maps.read_map(yaml)
    for data, why in ((b"\xff\xfe\x00", "UTF-16"), (b"# B\xfcro\n", "byte 3 is no UTF-8; save it")):
        yaml.write_bytes(data)
        with pytest.raises(LogFormatError, match=f"not a text file: .*{why}"):
            maps.read_map(yaml)


def test_an_unwritable_place_leaves_nothing(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot write"):
        maps.write_map(tmp_path / "file" / "map", small_map())
    (tmp_path / "map.pgm").mkdir()
    with pytest.raises(OutputError):
        maps.write_map(tmp_path / "map", small_map())
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "map.pgm"]


def test_a_raster_without_cells_is_no_map(tmp_path):
    empty = Raster(values=np.zeros((0, 4)), resolution_m=0.05, T_map_origin=[0.0, 0.0, 0.0])
    with pytest.raises(InvalidValueError, match="needs 1 to"):
        maps.write_map(tmp_path / "m", empty)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("mode", "means"),
    [
        ("trinary", [1.0, np.nan, 0.0, 0.0]),
        ("scale", [1.0, 0.5, 0.0, 0.0]),  # 0.196 is below the threshold: free
        ("raw", [0.0, np.nan, np.nan, np.nan]),
    ],
)
def test_a_map_server_file_with_a_png_means_what_its_mode_says(tmp_path, mode, means):
    grays = np.array([[0, 153, 205, 254]], dtype=np.uint8)
    Image.fromarray(grays).save(tmp_path / "map.png")
    yaml = tmp_path / "map.yaml"
    yaml.write_text(
        f"image: map.png\nmode: {mode}\nresolution: 0.1\norigin: [0, 0, 0.3]\nnegate: 0\n"
        "occupied_thresh: 0.6\nfree_thresh: 0.2\n"
    )
    read = maps.read_map(yaml)
    assert read.values[0] == pytest.approx(means, nan_ok=True, abs=1e-6)
    saved = maps.read_map(yaml, saved=True).values[0]
    assert np.isnan(saved[2])
    assert read.T_map_origin[2] == 0.3


def _png_of(edge, colour, image):
    def chunk(kind, data):
        crc = zlib.crc32(kind + data).to_bytes(4, "big")
        return len(data).to_bytes(4, "big") + kind + data + crc

    header = chunk(b"IHDR", edge.to_bytes(4, "big") * 2 + bytes((8, colour, 0, 0, 0)))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(image))


@pytest.mark.parametrize(
    ("png", "said"),
    [
        (_png_of(14000, 0, b""), "exceeds limit of 178956970 pixels"),  # not unpacked
        (_png_of(2, 3, bytes(6)), "its palette is missing"),
    ],
)
def test_a_png_that_cannot_be_read_is_refused(tmp_path, png, said):
    (tmp_path / "map.png").write_bytes(png)
    yaml = tmp_path / "map.yaml"
    yaml.write_text(
        "image: map.png\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.6\nfree_thresh: 0.2\n"
    )
    with pytest.raises(LogFormatError, match=said):
        maps.read_map(yaml, saved=True)

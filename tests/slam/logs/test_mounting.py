# SPDX-License-Identifier: Apache-2.0
"""How a scanner is mounted is found from its scans and what the robot drove between them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slam.frames import Frame, Stream, StreamMetadata
from slam.logs.mounting import Mounting, MountingTest, remounted
from tests.world2d import Drive, World2D, frames, laser, office, office_loop, rectangle


@pytest.fixture(scope="module")
def driven() -> list[Frame]:
    return frames(World2D(office()), office_loop(), rate_hz=4.0, spec=laser(181), seed=4)


def stream_of(found: list[Frame]) -> Stream:
    scan = found[0].scan
    assert scan is not None
    metadata = StreamMetadata(source="test", laser=scan.spec)
    return Stream(metadata=metadata, frames=lambda: found, length=len(found))


def told(stream: Stream) -> list[Mounting]:
    test = MountingTest()
    for frame in stream:
        test.note(frame)
    return test.told()


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("turned_deg", [0, 90, 180, 270])
def test_whatever_was_assumed_the_right_mounting_is_found(
    driven: list[Frame], turned_deg: int, flip: bool
) -> None:
    """A scanner that looks ahead, read as if it were mounted otherwise; the way back is named."""
    wrong = np.array([0.1, 0.0, math.radians(turned_deg)])
    stream = remounted(stream_of(driven), wrong, flip=flip, by="a wrong flag")
    assert stream.metadata.mounting == "a wrong flag"
    best, following = told(stream)[:2]
    assert (best.turned_deg, best.flipped) == ((-turned_deg) % 360, flip)
    assert best.probability > 1.0 - 1e-6 > following.probability
    assert best.apart_m < 0.1
    assert best.as_read == (turned_deg == 0 and not flip)


@pytest.mark.parametrize("turned_deg", [-130, 20, 45, 100])
def test_a_turn_between_quarters_is_found(driven: list[Frame], turned_deg: int) -> None:
    wrong = np.array([0.1, 0.0, math.radians(turned_deg)])
    best = told(remounted(stream_of(driven), wrong, flip=False, by="a wrong flag"))[0]
    off = (best.turned_deg + turned_deg + 180) % 360 - 180
    assert abs(off) <= 3
    assert not best.flipped
    assert not best.as_read
    assert best.probability > 0.99


def test_along_a_bare_corridor_nothing_tells_ahead_from_behind() -> None:
    hall = World2D(rectangle(-300.0, -1.0, 300.0, 1.01))
    drive = Drive((0.0, 0.0, 0.0), ((0.5, 0.0, 30.0),))
    found = told(stream_of(frames(hall, drive, rate_hz=4.0, spec=laser(181, range_max=20.0))))
    shares = {(one.turned_deg, one.flipped): one.probability for one in found}
    assert shares[0, False] < 0.9
    assert shares[90, False] + shares[270, False] < 0.1


def test_who_stood_still_is_not_judged(driven: list[Frame]) -> None:
    assert told(stream_of([driven[0]] * 50)) == []


def test_remounting_twice_by_a_flip_gives_the_same_scans(driven: list[Frame]) -> None:
    stream = stream_of(driven[:3])
    again = remounted(remounted(stream, None, flip=True, by="--flip"), None, flip=True, by="--flip")
    assert list(again) == driven[:3]
    mirrored = next(iter(remounted(stream, None, flip=True, by="--flip"))).scan
    first = driven[0].scan
    assert mirrored is not None
    assert first is not None
    np.testing.assert_array_equal(mirrored.ranges, first.ranges[::-1])
    np.testing.assert_allclose(mirrored.spec.angles, -first.spec.angles[::-1], atol=1e-12)


def test_beam_times_and_intensities_turn_round_with_the_beams(driven: list[Frame]) -> None:
    frame, scan = driven[0], driven[0].scan
    assert scan is not None
    shining = np.arange(scan.spec.n_beams, dtype=np.float32)
    spec = laser(181, interlaced=True)
    seen = replace(frame, scan=replace(scan, spec=spec, intensities=shining))
    turned = next(iter(remounted(stream_of([seen]), None, flip=True, by="--flip"))).scan
    assert turned is not None
    assert turned.intensities is not None
    assert turned.intensities[0] == shining[-1]
    assert turned.spec.beam_time_offsets[0] == spec.beam_time_offsets[-1]

# SPDX-License-Identifier: Apache-2.0
"""What an export cannot hold is refused in words."""

from dataclasses import replace

import numpy as np
import pytest

from scripts.exports import WRITERS
from slam.errors import InvalidValueError
from slam.frames import Stream, StreamMetadata
from tests.world2d import frame_at, laser


def test_npz_holds_scans_of_one_geometry(tmp_path):
    frames = [frame_at(k, ranges=np.ones(n), spec=laser(n)) for k, n in enumerate((181, 180))]
    stream = Stream(metadata=StreamMetadata(source="test"), frames=lambda: iter(frames))
    with pytest.raises(InvalidValueError, match="npz holds scans of one geometry"):
        WRITERS["npz"](tmp_path / "a.npz", stream, "")
    same = replace(stream, frames=lambda: iter(frames[:1]))
    assert WRITERS["npz"](tmp_path / "a.npz", same, "")[0].exists()

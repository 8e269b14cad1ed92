# SPDX-License-Identifier: Apache-2.0
"""Robots with several scanners."""

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

from scripts.single_run.log_words import understood
from slam.frames import Frame
from slam.logs import read_bag
from slam.logs.together import together
from tests.scripts.kinds.kind import Kind
from tests.slam.logs.two_scanners import MOUNTS, bag


def _read(path: Path, strict: bool) -> tuple[str, list[Frame]]:
    topics = ("/front", "/rear")
    stream = together([read_bag(path, scan=topic, strict=strict) for topic in topics])
    seen = SimpleNamespace(stream=stream, title=path.name, scans=0, duration_s=1.0)
    return understood(seen), list(stream)


def _in_turns(frames: Sequence[Frame]) -> None:
    mounts = [frame.scan.spec.mount for frame in frames]
    assert mounts == [*MOUNTS.values()] * (len(frames) // 2)


KINDS = [
    Kind(
        name="several scanners of one robot, each named by `--scan`",
        done="their scans in the order of their stamps, each with its own place, view and noise",
        said="/front; 91 beams …; /rear, 61 beams …, by base_link -> rear of /tf_static",
        write=lambda folder: bag(folder / "two"), check=_in_turns, read=_read,
    ),
    Kind(
        name="several, and no transforms to them",
        done="refused",
        said="nothing says how the scanner of … is mounted, and there are several",
        write=lambda folder: bag(folder / "two", transforms=False), check=None, read=_read,
    ),
]  # fmt: skip

# SPDX-License-Identifier: Apache-2.0
"""Random damage to a log, the same on every run."""

from pathlib import Path

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from slam.errors import LogFormatError
from slam.frames import Frame
from slam.logs import open_log

Edits = list[tuple[int, int, bytes]]
FUZZED = settings(
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def edits(new: st.SearchStrategy[bytes], longest: int) -> st.SearchStrategy[Edits]:
    """One to four places of a file: where, how many bytes go (at most ``longest``), what comes."""
    edit = st.tuples(st.integers(0, 10_000), st.integers(0, longest), new)
    return st.lists(edit, min_size=1, max_size=4)


def edited(data: bytes, places: Edits) -> bytes:
    out = bytearray(data)
    for at, length, new in places:
        at %= max(len(out), 1)
        out[at : at + length] = new
    return bytes(out)


def frames_or_refused(path: Path, data: bytes) -> list[Frame] | None:
    """The frames of a log of these bytes; None where an error refused it, which names the file."""
    path.write_bytes(data)
    try:
        return list(open_log(path))
    except LogFormatError as error:
        message = str(error)
    assert path.name in message
    return None

# SPDX-License-Identifier: Apache-2.0
"""Readers of recorded logs: one function each, path -> Stream."""

from slam.logs.bag import read_bag
from slam.logs.carmen import read_carmen, write_carmen
from slam.logs.centimetre import read_centimetre
from slam.logs.open import open_log
from slam.logs.rawlog import read_rawlog
from slam.logs.rover import read_rover
from slam.logs.victoria_park import read_victoria_park

__all__ = [
    "open_log", "read_bag", "read_carmen", "read_centimetre", "read_rawlog", "read_rover",
    "read_victoria_park", "write_carmen",
]  # fmt: skip

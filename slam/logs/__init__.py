# SPDX-License-Identifier: Apache-2.0
"""Readers of recorded logs: one function each, path -> Stream."""

from slam.logs.carmen import read_carmen
from slam.logs.carmen_writer import write_carmen
from slam.logs.open import open_log

__all__ = ["open_log", "read_carmen", "write_carmen"]

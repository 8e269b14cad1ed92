# SPDX-License-Identifier: Apache-2.0
"""Readers of recorded logs: one function each, path -> Stream."""

from slam.logs.carmen import read_carmen

__all__ = ["read_carmen"]

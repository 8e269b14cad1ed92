# SPDX-License-Identifier: Apache-2.0
"""Compiled code that prints, without what it prints."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quiet() -> Iterator[None]:
    """Nothing reaches this process's standard output meanwhile, whoever writes to it.

    What was written before it does, and later output does again, whatever is raised.
    """
    libc = ctypes.CDLL(None)
    sys.stdout.flush()
    libc.fflush(None)  # what C has kept so far is not to be dropped
    kept = os.dup(1)
    try:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.close(nothing)
        try:
            yield
        finally:
            try:
                sys.stdout.flush()
                libc.fflush(None)
            finally:
                os.dup2(kept, 1)
    finally:
        os.close(kept)

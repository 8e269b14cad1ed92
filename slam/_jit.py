# SPDX-License-Identifier: Apache-2.0
"""One decorator for every hot loop: Numba, cached on disk, deterministic, typed for mypy.

No ``fastmath`` and no ``parallel``: results must not depend on how a compiler reassociates sums.
Where no folder for the compile cache can be written (read-only install, no HOME) the kernels are
compiled anew in each process, which takes some seconds and is said once in the log.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numba

_log = logging.getLogger(__name__)
_cache_is_writable = True

P = ParamSpec("P")
R = TypeVar("R")


def njit(function: Callable[P, R]) -> Callable[P, R]:
    """``numba.njit(cache=True, nogil=True)``; without the cache where none can be written."""
    global _cache_is_writable
    if _cache_is_writable:
        try:
            cached: Callable[P, R] = numba.njit(cache=True, nogil=True)(function)
            return cached
        except RuntimeError as error:  # "cannot cache function ...: no locator available"
            if "no locator" not in str(error):
                raise
            _cache_is_writable = False
            _log.warning(
                "no folder for compiled code can be written (set NUMBA_CACHE_DIR to one that can): "
                "compiling anew, which takes some seconds in every process"
            )
    compiled: Callable[P, R] = numba.njit(nogil=True)(function)
    return compiled

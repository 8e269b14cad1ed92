# SPDX-License-Identifier: Apache-2.0
"""Say so when kernels are compiled, and do it no slower than need be."""

from __future__ import annotations

import gc
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# isort: off
from slam import _numba  # noqa: F401  (before anything else imports Numba)

# isort: on
from numba.core import event

_log = logging.getLogger(__name__)
COMPILING = "numba:compile"


class _SayOnce(event.Listener):  # type: ignore[misc]  # numba has no types
    """Logs one line when a kernel is really compiled, none when it comes from the cache."""

    def __init__(self, what: str) -> None:
        self.what = what
        self.said = False

    def on_start(self, event: Any) -> None:
        if not self.said:
            _log.info("compiling %s, which takes some seconds the first time", self.what)
        self.said = True

    def on_end(self, event: Any) -> None:
        pass


@contextmanager
def announced(what: str) -> Iterator[None]:
    """Run the kernels of ``what`` for the first time in here.

    The collector of cyclic garbage rests: a compiler makes millions of objects and few cycles, and
    looking through them takes a tenth of its time.
    """
    listener, collected = _SayOnce(what), gc.isenabled()
    event.register(COMPILING, listener)
    gc.disable()
    try:
        yield
    finally:
        if collected:
            gc.enable()
        event.unregister(COMPILING, listener)

# SPDX-License-Identifier: Apache-2.0
"""One decorator for every hot loop: Numba, cached on disk, deterministic, typed for mypy.

No ``fastmath`` and no ``parallel``: results must not depend on how a compiler reassociates sums.
Where no folder for the compile cache can be written (read-only install, no HOME) the kernels are
compiled again in each process, which takes some seconds and is said once in the log.

Numba's cache looks at the file of the kernel itself only; a kernel that calls one of another module
would keep its old code after that module changed. So the files of imported kernels count too, and
the values of the module constants that a kernel and its callees use, which may come from elsewhere
(a tree of numbers, say).

Each file of the cache ends with the hash of what is before it, and has its name once it is on the
disk. One that is torn, flipped or empty is as if it were not there: code that is damaged would end
the process, without a word.
"""

import gc
import hashlib
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from io import BytesIO
from pathlib import Path
from types import ModuleType
from typing import Any, ParamSpec, TypeVar

# isort: off
from slam._numba import link_once  # before anything else imports Numba

# isort: on
import numba
from numba.core import event

from slam.files import write_bytes

_log = logging.getLogger(__name__)
_cache_is_writable = True
link_once()
_OPTIONS = {"nogil": True, "no_cfunc_wrapper": True}

P = ParamSpec("P")
R = TypeVar("R")


def njit(function: Callable[P, R], *, counted: bool = True) -> Callable[P, R]:
    """``numba.njit`` without the interpreter's lock, and with a cache where one can be written."""
    global _cache_is_writable
    options = {**_OPTIONS, "_nrt": counted}
    if _cache_is_writable:
        try:
            cached: Callable[P, R] = numba.njit(cache=True, **options)(function)
            _watch_callees(cached, function)
            return cached
        except RuntimeError as error:  # "cannot cache function ...: no locator available"
            if "no locator" not in str(error):
                raise
            _cache_is_writable = False
            _log.warning(
                "no folder for compiled code can be written (set NUMBA_CACHE_DIR to one that can): "
                "compiling again, which takes some seconds in every process"
            )
    compiled: Callable[P, R] = numba.njit(**options)(function)
    return compiled


def uncounted(function: Callable[P, R]) -> Callable[P, R]:
    """``njit`` that counts no references to arrays, nor do the ``inner`` kernels that it calls.

    For kernels that allocate nothing (Numba refuses what would) and return no array, so that all
    arrays are the caller's. Counting them was a tenth of a step of the office.
    """
    return njit(function, counted=False)


def inner(function: Callable[P, R], **options: bool) -> Callable[P, R]:
    """For kernels that only other kernels call: no entry from Python, no cache of their own.

    They are compiled into each caller; leaving the rest out saves a fifth of a cold start.
    """
    compiled: Callable[P, R] = numba.njit(no_cpython_wrapper=True, **_OPTIONS, **options)(function)
    _watch_callees(compiled, function)
    return compiled


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """``inner``, and without a call where they are used: for a few operations on many numbers."""
    return inner(function, forceinline=True)


def _watch_callees(dispatcher: Any, function: Any) -> None:
    """Make the cached code of ``function`` depend on the files of the kernels it imports, and on
    the constants that it and its module's kernels use."""
    own = function.__code__.co_filename
    files: set[str] = set()
    constants = _constants(function)
    for value in function.__globals__.values():
        if hasattr(value, "py_func"):
            files |= getattr(value, "kernel_files", {value.py_func.__code__.co_filename})
            constants |= getattr(value, "kernel_constants", set())
    files.discard(own)
    dispatcher.kernel_files = {own, *files}
    dispatcher.kernel_constants = constants
    index = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if index is None:
        return
    index._load_index, index._load_data = _undamaged(index)
    index._open_for_write = _whole
    index.save = partial(_save, index)
    if files or constants:
        digest = hashlib.sha256(b"".join(Path(f).read_bytes() for f in sorted(files)))
        digest.update("\n".join(sorted(constants)).encode())
        index._source_stamp = (index._source_stamp, digest.hexdigest())


def _constants(function: Any) -> set[str]:
    """The constants that a kernel names, with their values: its module's, and ``columns.SPEED``."""
    names, own = function.__code__.co_names, function.__globals__
    spaces = {function.__module__: own}
    for value in map(own.get, names):
        if isinstance(value, ModuleType):
            spaces[value.__name__] = vars(value)
    return {
        f"{module}.{name} = {space[name]!r}"
        for module, space in spaces.items()
        for name in names
        if isinstance(space.get(name), int | float | str | tuple)
    }


def _save(index: Any, key: Any, data: Any) -> None:
    """As ``IndexDataCacheFile.save``, but a file of code is never that of another key or source.

    Numba numbers the files: of two processes that compile at once, one may then load what the
    other compiled for other types. Named after what they hold, and written before the index names
    them, they are always right; an entry lost to the other process is compiled once more, and so
    is one for which the disk has no room.
    """
    held = hashlib.sha256(index._dump((index._source_stamp, key))).hexdigest()[:16]
    name = index._data_name_pattern.replace("{number:d}", held)
    with suppress(OSError):
        index._save_data(name, data)
        index._save_index({**index._load_index(), key: name})


@contextmanager
def _whole(path: str) -> Iterator[BytesIO]:
    """A file of the cache to be written; Numba, which unpickles it, sees no hash at its end."""
    held = BytesIO()
    yield held
    data = held.getvalue()
    write_bytes(Path(path), data + hashlib.sha256(data).digest())


def _is_whole(path: str) -> bool:
    try:
        held = Path(path).read_bytes()
    except OSError:
        return False
    size = hashlib.sha256().digest_size
    return hashlib.sha256(held[:-size]).digest() == held[-size:]


def _undamaged(index: Any) -> tuple[Callable[[], dict[Any, Any]], Callable[[str], Any]]:
    """Its readers of the index and of an entry, for which nothing is there but what is whole.

    A cache of an older version may name types that are gone: then there is nothing in it.
    """
    load_index, load_data = index._load_index, index._load_data

    def entries() -> dict[Any, Any]:
        try:
            return load_index() if _is_whole(index._index_path) else {}
        except (AttributeError, ImportError):
            return {}

    def entry(name: str) -> Any:
        if not _is_whole(index._data_path(name)):
            raise FileNotFoundError(name)  # which Numba expects
        return load_data(name)

    return entries, entry


COMPILING = "numba:compile"


class _SayOnce(event.Listener):  # type: ignore[misc]  # numba has no types
    """Logs one line when a kernel is really compiled, none when it comes from the cache."""

    def __init__(self, what: str, about_s: float) -> None:
        self.what, self.about_s = what, about_s
        self.said = False

    def on_start(self, event: Any) -> None:
        if not self.said:
            _log.info("compiling %s, the first time only: about %.0f s", self.what, self.about_s)
        self.said = True

    def on_end(self, event: Any) -> None:
        pass


class _Uncollected(event.Listener):  # type: ignore[misc]  # numba has no types
    """Lets the collector of cyclic garbage rest while anything is compiled.

    A compiler makes millions of objects and few cycles, and looking through them takes a tenth of
    its time.
    """

    def __init__(self) -> None:
        self.depth = 0
        self.collected = False

    def on_start(self, event: Any) -> None:
        if self.depth == 0:
            self.collected = gc.isenabled()
            gc.disable()
        self.depth += 1

    def on_end(self, event: Any) -> None:
        self.depth -= 1
        if self.depth == 0 and self.collected:
            gc.enable()


event.register(COMPILING, _Uncollected())


@contextmanager
def announced(what: str, about_s: float) -> Iterator[None]:
    """Run the kernels of ``what`` for the first time in here, which takes so long to compile."""
    listener = _SayOnce(what, about_s)
    event.register(COMPILING, listener)
    try:
        yield
    finally:
        event.unregister(COMPILING, listener)

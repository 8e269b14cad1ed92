# SPDX-License-Identifier: Apache-2.0
"""Numba as it is to work here: without the settings of the working folder, optimising once.

Numba reads ``.numba_config.yaml`` there, now and at every compilation. That file can say where
compiled code is loaded from, and Numba loads that with pickle: a folder of somebody else's data
could so run code. ``NUMBA_*`` variables of the environment count as ever. Its error messages have
no colours: it writes one for each overload that it tries and drops, a thirtieth of a cold start.

By itself Numba optimises each function and makes machine code of it, and again inside of whatever
calls it: what is five calls deep is compiled six times, and only the outermost code runs. With
``link_once`` a function that no Python calls stays as it was written until its callers have it. The
code that runs is as fast, and its results are the same: LLVM never reorders floating-point
arithmetic. Which of Numba's own functions fits types is worked out once, too. This reaches into
Numba, so it is for the versions that it was tried with; others compile as they do by themselves,
which takes half as long again.
"""

import ctypes
import os
from contextlib import chdir, nullcontext
from pathlib import Path
from typing import Any

os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")
with chdir(os.sep) if Path(".numba_config.yaml").exists() else nullcontext():
    import numba.core.config
numba.core.config._config_fname = os.devnull  # is no regular file: nothing is read from it

from numba.core import codegen, errors, utils  # noqa: E402
from numba.core.target_extension import get_local_target  # noqa: E402
from numba.core.types import functions  # noqa: E402

TRIED = (0, 68)  # major and minor version of Numba


class OnceLinked(codegen.JITCodeLibrary):  # type: ignore[misc]  # numba has no types
    """A library of code that is optimised and made executable only where Python enters it."""

    _finalized: bool

    def add_linking_library(self, library: Any) -> None:
        """Remember what this calls."""
        self._linking_libraries.append(library)

    def _optimize_functions(self, ll_module: Any) -> None:
        """Nothing yet: the whole is optimised."""
        ll_module.data_layout = self._codegen._data_layout

    def _get_module_for_linking(self) -> Any:
        """As Numba's, of code that need not be finished."""
        finished, self._finalized = self._finalized, True
        try:
            return super()._get_module_for_linking()
        finally:
            self._finalized = finished

    def finalize(self) -> None:
        """As Numba's, with what is called by what this calls."""
        self._shared_module = None
        self._linking_libraries = _callers_first(self)
        super().finalize()

    def get_pointer_to_function(self, name: str) -> int:
        """Address of the entry from Python; 0 where there is none, and then nothing is made."""
        if not self._finalized and all(f.name != name for f in self._final_module.functions):
            return 0
        return int(super().get_pointer_to_function(name))


def _set_env(self: Any, env_name: str, env: Any) -> None:
    """As Numba's; code that Python does not enter needs no environment."""
    address = self._engine.get_global_value_address(env_name)
    if address:
        (ctypes.c_void_p * 1).from_address(address)[0] = ctypes.c_void_p(id(env))


def _callers_first(library: Any) -> list[Any]:
    """All that a library calls, directly or not, in an order in which LLVM's linker, which drops
    what nobody has asked for so far, keeps all of it."""
    seen: set[Any] = set()
    order: list[Any] = []

    def walk(one: Any) -> None:
        for called in reversed(one._linking_libraries):
            if called not in seen:
                seen.add(called)
                if not called._finalized:
                    walk(called)
                order.append(called)

    walk(library)
    return order[::-1]


_fitted: dict[Any, tuple[Any, bool]] = {}
_Function: Any = functions.BaseFunction
_explained = _Function.get_call_type  # tries all, and says why none of them fits
_plain: Any = vars(functions).get("_unlit_non_poison")  # a type without the value of a constant


def _call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
    """As Numba's, which tries all implementations at each call: an addition, ten of them.

    The one that fitted these types before is the first that does: what fits depends on types alone.
    """
    key = context, self.templates, tuple(args), tuple(kws.items())
    choices = [_fitted[key]] if key in _fitted else _choices(self, context)
    for template, literally in choices:
        one = template(context)
        try:
            if literally:
                fitting = one.apply(args, kws)
            else:
                fitting = one.apply(
                    tuple(map(_plain, args)),
                    {name: _plain(kind) for name, kind in kws.items()},
                )
        except errors.NumbaError:
            continue
        if fitting is not None:
            self._impl_keys[fitting.args] = one.get_impl_key(fitting)
            _fitted[key] = template, literally
            return fitting
    return _explained(self, context, args, kws)


def _choices(function: Any, context: Any) -> list[tuple[Any, bool]]:
    """The implementations in Numba's order, each with and without the values of constants."""
    target = get_local_target(context)
    order = utils.order_by_target_specificity(target, function.templates, fnkey=function.key[0])
    return [
        (template, literally)
        for template in order
        for literally in (template.prefer_literal, not template.prefer_literal)
    ]


def link_once() -> None:
    """Let Numba work so from now on."""
    if numba.version_info.short == TRIED and _plain is not None:
        codegen.JITCPUCodegen._library_class = OnceLinked
        codegen.JITCPUCodegen.set_env = _set_env
        _Function.get_call_type = _call_type

# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's step, callable from compiled code: one call from Python can be many substeps.

``mj_step`` is ``mj_step1`` (where everything is: kinematics, contacts, velocities) followed by
``mj_step2`` (what that leads to: forces, accelerations, the new state). Called the other way round,
step2 and then step1, each substep ends with fresh poses, and nothing is computed twice.

An error of MuJoCo inside compiled code ends the process with its message: there is no Python above
it to raise in. What a run can meet (divergence, too many contacts) is a warning, as ever.
"""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import mujoco
from llvmlite import ir
from numba import types
from numba.extending import intrinsic


class Engine(NamedTuple):
    """Addresses of ``mj_step1``, ``mj_step2``, and of one model and its data."""

    step1: int
    step2: int
    model: int
    data: int


def engine(model: mujoco.MjModel, data: mujoco.MjData) -> Engine:
    """The engine of one room; it must not outlive ``model`` and ``data``."""
    # The bindings are linked to MuJoCo, so its functions are found through them.
    library = ctypes.CDLL(mujoco._functions.__file__)
    steps = [_address(getattr(library, name)) for name in ("mj_step1", "mj_step2")]
    return Engine(steps[0], steps[1], model._address, data._address)


def _address(function: Any) -> int:
    found = ctypes.cast(function, ctypes.c_void_p).value
    assert found is not None  # a function of a loaded library has an address
    return found


@intrinsic  # type: ignore[untyped-decorator]
def call(typing_context: Any, function: Any, model: Any, data: Any) -> Any:
    """Call ``void function(mjModel*, mjData*)``; all three are addresses."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, pointer]).as_pointer()
        room = [builder.inttoptr(argument, pointer) for argument in args[1:]]
        builder.call(builder.inttoptr(args[0], kind), room)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate

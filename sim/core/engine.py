# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's step, callable from compiled code: one call from Python can be many substeps.

``mj_step`` is ``mj_step1`` (where everything is: kinematics, contacts, velocities) followed by
``mj_step2`` (what that leads to: forces, accelerations, the new state). Called the other way round,
step2 and then step1, each substep ends with fresh poses, and nothing is computed twice.

An error of MuJoCo inside compiled code ends the process with its message: there is no Python above
it to raise in. What a run can meet (divergence, too many contacts) is a warning, which
``warned`` tells; nothing is written to MuJoCo's log in the working folder.
"""

import ctypes
from typing import Any, NamedTuple

# isort: off
from slam import _numba  # noqa: F401  (before anything else imports Numba)

# isort: on
import mujoco
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from slam._jit import inner
from slam.errors import UnstableError

_AT_A_JOINT = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)
mujoco.set_mju_user_warning(lambda _: None)  # else it writes MUJOCO_LOG.TXT


class Engine(NamedTuple):
    """Addresses of ``mj_step1``, ``mj_step2``, ``mj_contactForce``, one model and its data."""

    step1: int
    step2: int
    force: int
    model: int
    data: int


def engine(model: mujoco.MjModel, data: mujoco.MjData) -> Engine:
    """The engine of one room; it must not outlive ``model`` and ``data``."""
    # The bindings are linked to MuJoCo, so its functions are found through them.
    library = ctypes.CDLL(mujoco._functions.__file__)
    names = ("mj_step1", "mj_step2", "mj_contactForce")
    step1, step2, force = (_address(getattr(library, name)) for name in names)
    return Engine(step1, step2, force, model._address, data._address)


def forward(model: mujoco.MjModel, data: mujoco.MjData, what: str) -> None:
    """``mj_forward``; ``UnstableError`` for more contacts than it has memory for."""
    try:
        mujoco.mj_forward(model, data)
    except mujoco.FatalError as error:
        raise UnstableError(f"{what}: {' '.join(str(error).split())}") from None


def warned(model: mujoco.MjModel, data: mujoco.MjData) -> str:
    """What MuJoCo has warned of since its data were reset; "" for nothing."""
    numbers = data.warning.number
    if not numbers.any():
        return ""
    kind = mujoco.mjtWarning(int(np.flatnonzero(numbers)[0]))
    at = int(data.warning.lastinfo[int(kind)])
    said = " ".join(mujoco.mju_warningText(int(kind), at).split())
    if kind not in _AT_A_JOINT:
        return said
    first = model.jnt_qposadr if kind == mujoco.mjtWarning.mjWARN_BADQPOS else model.jnt_dofadr
    joint = model.joint(int(np.searchsorted(first, at, side="right")) - 1).name
    return f"{said} (joint '{joint}')"


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


@intrinsic  # type: ignore[untyped-decorator]
def _call_force(
    typing_context: Any, function: Any, model: Any, data: Any, contact: Any, out: Any
) -> Any:
    """``mj_contactForce(model, data, contact, out)``; all but the number are addresses."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [pointer, pointer, number, pointer]).as_pointer()
        room = [builder.inttoptr(argument, pointer) for argument in (args[1], args[2], args[4])]
        room.insert(2, builder.trunc(args[3], number))
        builder.call(builder.inttoptr(args[0], kind), room)
        return context.get_dummy_value()

    return types.void(*(types.int64,) * 5), generate


@inner
def call_force(
    function: int, model: int, data: int, contact: int, wrench: NDArray[np.float64]
) -> None:
    """Force and torque (6,) N, N m of a contact in its own frame; zeros where there is none."""
    _call_force(function, model, data, contact, wrench.ctypes.data)

# SPDX-License-Identifier: Apache-2.0
"""Whether this machine can draw in 3-D, and by which library, without risking the process.

MuJoCo picks its GL library from ``MUJOCO_GL`` while it is imported, and when that names a library
that is not there the import itself dies with an AttributeError. So nothing here sets the variable,
each library is tried in a subprocess that draws 8 x 8 pixels, and this module does not import
mujoco. ``sim.view.camera`` makes its context from the answer, whatever MuJoCo picked for itself.
"""

import os
import subprocess
import sys
from dataclasses import dataclass
from functools import cache

VARIABLE = "MUJOCO_GL"
TIMEOUT_S = 120.0

_DRAW = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
renderer = mujoco.Renderer(model, 8, 8)
renderer.update_scene(data)
assert renderer.render().shape == (8, 8, 3)
renderer.close()
"""


@dataclass(frozen=True, kw_only=True)
class Gl:
    """``backend``: "egl", "osmesa", "glfw", "cgl" or None; ``reason``: one line, why None."""

    backend: str | None
    reason: str = ""


@cache
def find() -> Gl:
    """The first GL library that can draw here; asked once per process, about a second."""
    failures = []
    for backend in _candidates():
        failure = _try(_DRAW, backend)
        if failure is None:
            return Gl(backend=backend)
        failures.append(f"{backend}: {failure}")
    return Gl(backend=None, reason="no GL library can draw here (" + "; ".join(failures) + ")")


def sanitise_environment() -> str | None:
    """Make ``import mujoco`` safe; call it before the first such import of a program.

    When ``MUJOCO_GL`` is set and MuJoCo cannot be imported with it, the variable is removed from
    this process and one line saying so is returned; else None. Nothing is run when it is not set.
    """
    value = os.environ.get(VARIABLE)
    if not value:
        return None
    failure = _try("import mujoco", value)
    if failure is None or _try("import mujoco", None) is not None:
        return None  # usable, or broken for another reason that the import will name
    del os.environ[VARIABLE]
    return f"{VARIABLE}={value} is ignored: MuJoCo cannot load it here ({failure})"


def _candidates() -> tuple[str, ...]:
    """What to try, in this order; PyOpenGL, once loaded, is bound to one of them."""
    bound = os.environ.get("PYOPENGL_PLATFORM", "").lower()
    if bound in ("egl", "osmesa"):
        return (bound,)
    if sys.platform == "darwin":
        return ("cgl",)
    if sys.platform == "win32":
        return ("glfw",)
    known = ["egl", "osmesa"]
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        known.append("glfw")
    wish = os.environ.get(VARIABLE, "").lower().strip()
    return tuple(sorted(known, key=lambda name: name != wish))


# It waits for the probe: the thread that started it does not end before this process does.
_ENDS_WITH_US = (  # PR_SET_PDEATHSIG of linux/prctl.h, SIGKILL
    "import ctypes; ctypes.CDLL(None).prctl(1, 9, 0, 0, 0)\n" if sys.platform == "linux" else ""
)


def _try(program: str, backend: str | None) -> str | None:
    """Run a Python program with that library; None when it worked, else why not, in one line."""
    environment = {name: value for name, value in os.environ.items() if name != VARIABLE}
    if backend is not None:
        environment[VARIABLE] = backend
    try:
        run = subprocess.run(
            [sys.executable, "-P", "-c", _ENDS_WITH_US + program],  # -P: no module from here
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"no answer within {TIMEOUT_S:.0f} s"
    except OSError as error:
        return str(error)
    if run.returncode == 0:
        return None
    lines = [line for line in run.stderr.splitlines() if line.strip()]
    last = lines[-1].strip()[:200] if lines else f"exit status {run.returncode}"
    # what PyOpenGL's loader says when there is nothing to load
    return "its library is not installed" if "'NoneType' object has no attribute" in last else last

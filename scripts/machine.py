# SPDX-License-Identifier: Apache-2.0
"""Where a number was made: versions of what can change it, and the machine."""

import os
import platform
import sys
from importlib import metadata
from pathlib import Path
from typing import Any


def versions() -> dict[str, str]:
    """Versions of everything that can change a number."""
    wanted = ("mobilia", "mujoco", "gymnasium", "numpy", "scipy", "numba", "opencv-python-headless")
    found = {}
    for name in wanted:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return {"python": platform.python_version(), **found}


def machine() -> dict[str, Any]:
    """The machine a figure was measured on."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": sys.version.split()[0],
    }


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()

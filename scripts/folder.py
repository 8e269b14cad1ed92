# SPDX-License-Identifier: Apache-2.0
"""Start without what lies in the working folder: it may be a folder of somebody else's data.

Installed as ``mobilia``, Python itself does not look for modules there. These are the ways round.
"""

from __future__ import annotations

import os
import sys


def leave_out() -> None:
    """Call it before anything but the standard library is imported."""
    _drop_empty_entries()
    os.environ.setdefault("PYTHONSAFEPATH", "mobilia")  # of children; OURS in slam.names
    if os.path.exists("matplotlibrc"):
        _import_matplotlib_elsewhere()


def _drop_empty_entries() -> None:
    """``PYTHONPATH=$PYTHONPATH:/x`` with nothing before the colon means the working folder."""
    words = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    if len(words) == 1 or "" not in words:
        return
    meant = [word for word in words if word]
    os.environ["PYTHONPATH"] = os.pathsep.join(meant)
    here = os.getcwd()
    ours = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    if here != ours and here not in map(os.path.abspath, meant):
        sys.path[:] = [folder for folder in sys.path if folder not in ("", here)]


def _import_matplotlib_elsewhere() -> None:
    """Its settings in the working folder come before the user's own, and may name programs."""
    here = os.getcwd()
    os.chdir(os.sep)
    try:
        import matplotlib  # noqa: F401
    finally:
        os.chdir(here)

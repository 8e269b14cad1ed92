# SPDX-License-Identifier: Apache-2.0
"""The console command's first breath: Ctrl-C is understood before the slow imports begin."""

import io
import os
import sys

from scripts import interrupt


def main() -> None:
    """Install the signal handlers, then load and run the command line."""
    interrupt.install()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # of ASCII, say: \u2713 for a tick
    try:
        leave_out()
        from sim.view import gl

        warning = gl.sanitise_environment()  # before anything imports mujoco, as verbs do
        from scripts.cli import main as command_line
    except interrupt.InterruptedBySignal:
        print("mobilia: interrupted", file=sys.stderr)
        sys.exit(130)
    command_line(warning)


def leave_out() -> None:
    """Start without what lies in the working folder: it may be a folder of somebody else's data.

    Call it before anything but the standard library is imported. Installed as ``mobilia``, Python
    itself does not look for modules there. These are the ways round.
    """
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


if __name__ == "__main__":
    main()

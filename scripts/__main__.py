# SPDX-License-Identifier: Apache-2.0
"""The console command's first breath: Ctrl-C is understood before the slow imports begin."""

from __future__ import annotations

import sys

from scripts import folder, interrupt


def main() -> None:
    """Install the signal handlers, then load and run the command line."""
    interrupt.install()
    try:
        folder.leave_out()
        from sim.view import gl

        warning = gl.sanitise_environment()  # before anything imports mujoco, as verbs do
        from scripts.cli import main as command_line
    except interrupt.InterruptedBySignal:
        print("mobilia: interrupted", file=sys.stderr)
        sys.exit(130)
    command_line(warning)


if __name__ == "__main__":
    main()

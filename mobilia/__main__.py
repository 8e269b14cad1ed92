# SPDX-License-Identifier: Apache-2.0
"""The console command ``mobilia``."""

import sys

import mobilia


def main() -> None:
    """Run it, unless somebody else's folder would be run in its place: one line says which."""
    sentence = mobilia.hidden()
    if sentence:
        print(f"mobilia: {sentence}", file=sys.stderr)
        sys.exit(1)
    from scripts.__main__ import main as command

    command()


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""``mobilia list``: which scenes and SLAMs there are."""

from __future__ import annotations

from rich.table import Table

from scripts.console import console
from slam import system


def listing() -> None:
    """List the registered scenes, SLAMs and Gymnasium environments."""
    import gymnasium

    import sim  # noqa: F401  (registers the environments)
    from scenes import registry

    table = Table(show_header=True, title_justify="left")
    for heading in ("what", "name", "about"):
        table.add_column(heading)
    for name in registry.names():
        table.add_row("scene", name, registry.describe(name))
    for name in system.names():
        table.add_row("SLAM", name, system.describe(name))
    for name in sorted(i for i in gymnasium.registry if i.startswith("mobilia/")):
        table.add_row("environment", name, f'gymnasium.make("sim:{name}")')
    console.print(table)

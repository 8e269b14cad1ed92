# SPDX-License-Identifier: Apache-2.0
"""``mobilia list``: which scenes, scanners and SLAMs there are."""

from __future__ import annotations

from rich.table import Table

from scripts.console import console
from slam import system


def listing() -> None:
    """List the registered scenes, scanners, SLAMs and Gymnasium environments."""
    import gymnasium

    from scenes import registry
    from sim.core.versions import WORLD
    from sim.sensors.lidar import registry as scanners

    table = Table("what", "name", "about")
    for name in registry.names():
        table.add_row("scene", name, registry.describe(name))
    for name in scanners.names():
        table.add_row("scanner", name, scanners.describe(name))
    for name in system.names():
        table.add_row("SLAM", name, system.describe(name))
    ours = (name for name in gymnasium.registry if name.startswith("mobilia/"))
    for name in sorted(name for name in ours if name.endswith(f"-v{WORLD}")):
        table.add_row("environment", name, f'gymnasium.make("sim:{name}")')
    console.print(table)

# SPDX-License-Identifier: Apache-2.0
"""``mobilia list``: which scenes, scanners and SLAMs there are."""

from collections.abc import Callable, Sequence

from rich.markup import escape
from rich.table import Table

from scripts.console import console
from slam import system

Entry = tuple[str, str]


def listing() -> None:
    """List the registered scenes, scanners, SLAMs and Gymnasium environments."""
    for title, entries in _sections():
        console.print(f"[bold]{title}[/bold]")
        width = max(len(name) for name, _ in entries)
        if console.is_interactive:
            console.print(_columns(entries, width))
        else:  # a line each, whole, for grep
            for name, about in entries:
                console.print(f"  {name:<{width}}  {about}", markup=False, soft_wrap=True)
        console.print()


def _sections() -> list[tuple[str, list[Entry]]]:
    """What is printed, by kind: names, and what each is."""
    import gymnasium

    from scenes import registry
    from sim.core.versions import WORLD
    from sim.sensors.lidar import registry as scanners

    ours = sorted(
        name
        for name in gymnasium.registry
        if name.startswith("mobilia/") and name.endswith(f"-v{WORLD}")
    )
    return [
        ("scenes (what may be set, with its default)", _told(registry.names(), registry.describe)),
        ("scanners", _told(scanners.names(), scanners.describe)),
        ("SLAMs", _told(system.names(), system.describe)),
        ("environments", [(name, f'gymnasium.make("sim:{name}")') for name in ours]),
    ]


def _told(names: Sequence[str], describe: Callable[[str], str]) -> list[Entry]:
    """Descriptions without the marks of a docstring."""
    return [(name, describe(name).replace("``", "")) for name in names]


def _columns(entries: list[Entry], width: int) -> Table:
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(min_width=width + 2, no_wrap=True)
    table.add_column()
    for name, about in entries:
        table.add_row(f"  {escape(name)}", escape(about))
    return table

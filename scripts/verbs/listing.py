# SPDX-License-Identifier: Apache-2.0
"""``mobilia list``: which scenes, scanners and SLAMs there are."""

from collections.abc import Iterator

from rich.markup import escape
from rich.table import Table

from scripts.console import console
from scripts.spec import spec
from slam import system


@spec
class Listing:
    """List the registered scenes, scanners, SLAMs and Gymnasium environments."""

    def __call__(self) -> None:
        for title, entries in _sections():
            console.print(f"[bold]{title}[/bold]")
            width = max(map(len, entries))
            if console.is_interactive:
                table = Table.grid(padding=(0, 2, 0, 0))
                table.add_column(min_width=width + 2, no_wrap=True)
                table.add_column()
                for name, about in entries.items():
                    table.add_row(f"  {escape(name)}", escape(about))
                console.print(table)
            else:  # a line each, whole, for grep
                for name, about in entries.items():
                    console.print(f"  {name:<{width}}  {about}", markup=False, soft_wrap=True)
            console.print()


def _sections() -> Iterator[tuple[str, dict[str, str]]]:
    """What is printed, by kind: names, and what each is, without the marks of a docstring."""
    import gymnasium

    from scenes import registry
    from sim.core.versions import WORLD
    from sim.sensors.lidar import registry as scanners

    for title, known in (
        ("scenes (what may be set, with its default)", registry),
        ("scanners", scanners),
        ("SLAMs", system),
    ):
        yield title, {name: known.describe(name).replace("``", "") for name in known.names()}
    ours = (n for n in gymnasium.registry if n.startswith("mobilia/") and n.endswith(f"-v{WORLD}"))
    yield "environments", {name: f'gymnasium.make("sim:{name}")' for name in sorted(ours)}

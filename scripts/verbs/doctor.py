# SPDX-License-Identifier: Apache-2.0
"""``mobilia doctor``: what works here, and how to get what does not."""

from rich.markup import escape
from rich.table import Table

from scripts.console import console, say, working
from scripts.spec import option, spec
from slam.errors import MobiliaError

_MARKS = {"ok": "[green]✓[/green]", "can do without": "[yellow]-[/yellow]",
          "missing": "[red]✗[/red]"}  # fmt: skip


@spec
class Doctor:
    """Say what works on this machine, and how to get what does not.

    3D pictures, films, cores, the cache of compiled loops, packages and extras with their versions.
    ✓ is there, - can be done without, ✗ is needed and missing: then the exit status is 1.
    """

    sizes: bool = option("Print what the virtual environment is made of, in MB.", False)

    def __call__(self) -> None:
        if self.sizes:
            _print_sizes()
            return
        from scripts.doctor.checks import findings

        with working("looking"):
            found = findings()
        for one in found:
            what = escape(f"{one.what:<24}")
            say(f"{_MARKS[one.state]} {what} {escape(one.found)}", highlight=False)
            if one.how:
                say(f"    to get it: {escape(one.how)}", highlight=False)
        missing = [one.what for one in found if one.state == "missing"]
        if missing:
            raise MobiliaError(f"needed and missing: {', '.join(missing)}")


def _print_sizes() -> None:
    import os
    from importlib import metadata

    found = {}
    for one in metadata.distributions():
        files = (file.locate() for file in one.files or ())
        there = (os.lstat(file).st_size for file in files if os.path.lexists(file))
        found[f"{one.metadata['Name']} {one.version}"] = sum(there) / 1e6
    table = Table("package", "MB")
    table.columns[1].justify = "right"
    for name, megabytes in sorted(found.items(), key=lambda item: (-item[1], item[0])):
        if megabytes >= 0.5:
            table.add_row(name, f"{megabytes:.0f}")
    console.print(table)
    say(f"{sum(found.values()):.0f} MB in all")

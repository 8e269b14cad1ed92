# SPDX-License-Identifier: Apache-2.0
"""Where the console command begins: are the packages of mobilia the ones that Python finds?

They are called ``slam``, ``sim``, ``scenes`` and ``scripts``. Others have folders of these names,
too. Nothing is imported here but what Python itself has loaded by now: the working folder, which
may be on the path, may hold a module of any name.
"""

import os
import sys

PACKAGES = ("slam", "sim", "scenes", "scripts")
HOME = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))  # holds them and this package


def hidden(*names: str) -> str:
    """A sentence about the first package that something else stands before; "" if none is.

    names  of packages; default all
    """
    for name in names or PACKAGES:
        found = _found(name)
        if not found:
            return f"the package '{name}' of mobilia is missing in {HOME}: install mobilia again"
        if os.path.realpath(found) != os.path.join(HOME, name):
            return (
                f"{found} hides the package '{name}' of mobilia: rename it, or keep "
                f"{os.path.dirname(found)} off Python's path (PYTHONPATH, or start elsewhere)"
            )
    return ""


def _found(name: str) -> str:
    """The folder or file that ``import name`` takes; "" for none."""
    if name in sys.modules:
        specs = [sys.modules[name].__spec__]
    else:
        finders = [finder for finder in sys.meta_path if hasattr(finder, "find_spec")]
        specs = [finder.find_spec(name, None) for finder in finders]
    for spec in specs:
        if spec is not None and spec.submodule_search_locations:
            return os.path.abspath(next(iter(spec.submodule_search_locations)))
        if spec is not None and spec.origin:
            return os.path.abspath(spec.origin)
    return ""

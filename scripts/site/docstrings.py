# SPDX-License-Identifier: Apache-2.0
"""An extension of griffe: docstrings of this project as Markdown, for the API reference."""

from typing import Any

from griffe import Extension, Object

from scripts.site.columns import as_markdown


class Columns(Extension):  # type: ignore[misc]  # griffe is only where the site is built
    """Rewrites every docstring once, when its object has been read."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Called by griffe for each module, class, function and attribute."""
        if obj.docstring is not None:
            obj.docstring.value = as_markdown(obj.docstring.value)

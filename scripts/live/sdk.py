# SPDX-License-Identifier: Apache-2.0
"""The Foxglove SDK, which is an extra: imported when a view is opened, never before."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

from slam.errors import MissingDependencyError


@dataclass(frozen=True)
class Sdk:
    """Modules of ``foxglove``: the package itself, its messages, channels and WebSocket server."""

    foxglove: Any
    messages: Any
    channels: Any
    websocket: Any

    def schema(self, name: str, data: bytes) -> Any:
        """A JSON schema of that name."""
        return self.foxglove.Schema(name=name, encoding="jsonschema", data=data)


def require() -> Sdk:
    """The SDK; ``MissingDependencyError`` with a remedy where it is not installed."""
    try:
        names = ("foxglove", "foxglove.messages", "foxglove.channels", "foxglove.websocket")
        return Sdk(*(importlib.import_module(name) for name in names))
    except ImportError as error:
        raise MissingDependencyError(
            "mobilia live needs the Foxglove SDK: pip install 'mobilia[live]'"
        ) from error

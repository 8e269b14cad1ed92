# SPDX-License-Identifier: Apache-2.0
"""The content of a result without what a clock said."""

from __future__ import annotations

import csv
import io
import json

import numpy as np

from sim.recording.sums import BESIDE, SUMS

CLOCKS = (
    "milliseconds",
    "ms_per_scan_p50",
    "ms_per_scan_p99",
    "ms_per_scan_p999",
    "peak_memory_mb",
    "cpu_s",
)
OF_CLOCKS = (SUMS, BESIDE)  # hashes of files that hold clock readings


def timeless(name: str, data: bytes | None) -> object:
    """The content of a file without clock readings."""
    if data is None or name.endswith(OF_CLOCKS):
        return None
    if name.endswith(".json"):
        return _without(json.loads(data))
    if name.endswith(".csv"):
        rows = list(csv.DictReader(io.StringIO(data.decode())))
        return [_without(row) for row in rows if row.get("metric") not in CLOCKS]
    if name.endswith(".npz"):
        with np.load(io.BytesIO(data)) as file:
            arrays = {key: file[key] for key in file.files if not key.endswith(CLOCKS)}
        row = _without(json.loads(arrays.pop("row").item())) if "row" in arrays else None
        return row, {key: (a.dtype.str, a.shape, a.tobytes()) for key, a in arrays.items()}
    return data


def _without(value: object) -> object:
    """JSON without what a clock said."""
    if isinstance(value, dict):
        told = {k: _without(v) for k, v in value.items()}
        return {k: v for k, v in told.items() if k not in CLOCKS and not _timing(k)}
    return [_without(item) for item in value] if isinstance(value, list) else value


def _timing(key: str) -> bool:
    return (
        key in ("timing", "cost", "wall_s", "slam_ms_per_scan", "real_time_factor") or "ms_" in key
    )

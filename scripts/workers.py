# SPDX-License-Identifier: Apache-2.0
"""The same call over many items: here, on processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import importlib
import os
import uuid
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TypeVar

import joblib
from joblib.externals.loky.process_executor import TerminatedWorkerError

from slam.errors import InvalidValueError, MissingDependencyError, MobiliaError, OutputError
from slam.files import write_text

MAX_JOBS = 1024
WORKERS_TIMEOUT_S = 30
T = TypeVar("T")
R = TypeVar("R")


def each(
    call: Callable[[T], R],
    items: Sequence[T],
    *,
    jobs: int = 1,
    cluster: str | None = None,
    shared: Path | None = None,
) -> Iterator[R]:
    """``call(item)`` for every item, results as they come.

    jobs     processes here; 1 runs in this one
    cluster  address of a Dask scheduler (tcp://host:port) instead
    shared   folder that every worker must see: checked before anything starts

    ``call`` must be a function of a module. An error of ours stops everything and is raised here.
    """
    check_jobs(jobs)
    if cluster is None and (jobs == 1 or len(items) < 2):
        yield from map(call, items)
        return
    with ExitStack() as stack:
        backend: dict[str, Any] = {"backend": "loky", "n_jobs": min(jobs, max(len(items), 1))}
        if cluster is not None:
            client = stack.enter_context(_client(cluster))
            if shared is not None:
                _check_shared(client, shared)
            backend = {"backend": "dask", "wait_for_workers_timeout": WORKERS_TIMEOUT_S}
        stack.enter_context(joblib.parallel_config(**backend))
        parallel = joblib.Parallel(return_as="generator_unordered", batch_size=1)
        results = parallel(joblib.delayed(_guarded)(call, item) for item in items)
        try:
            for result, error in results:
                if error is not None:
                    raise error
                yield result
        except TerminatedWorkerError as error:
            raise MobiliaError(
                "a worker process was killed, perhaps for want of memory; "
                "the same command again goes on from here"
            ) from error
        finally:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # that tasks are cancelled: we know
                results.close()


def check_jobs(jobs: int) -> None:
    """``InvalidValueError`` for a number of processes that cannot be."""
    if isinstance(jobs, bool) or not 1 <= jobs <= MAX_JOBS:
        raise InvalidValueError(f"--jobs must be 1 to {MAX_JOBS}, got {jobs}")


def _guarded(call: Callable[[T], R], item: T) -> tuple[R | None, MobiliaError | None]:
    """Errors as values: as exceptions they would come back wrapped in a worker's traceback."""
    try:
        return call(item), None
    except MobiliaError as error:
        return None, error


def _client(address: str) -> Any:
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise MissingDependencyError(
            "--cluster needs Dask: pip install 'mobilia[cluster]'"
        ) from error
    try:
        return distributed.Client(address, timeout="10s", set_as_default=True)
    except (OSError, ValueError, TypeError) as error:
        raise InvalidValueError(f"no Dask scheduler at {address}: {error}") from error


def _check_shared(client: Any, folder: Path) -> None:
    """Every worker must find in ``folder`` what is written there now."""
    try:
        client.wait_for_workers(1, timeout=WORKERS_TIMEOUT_S)
    except TimeoutError:
        raise OutputError(
            f"the Dask cluster has no worker after {WORKERS_TIMEOUT_S} s of waiting"
        ) from None
    token = folder / f".{uuid.uuid4().hex}.token"
    write_text(token, token.name)
    try:
        seen = client.run(_sees, str(token))
    finally:
        token.unlink(missing_ok=True)
    blind = sorted(worker for worker, sees in seen.items() if not sees)
    if blind:
        raise OutputError(f"{folder} is not shared by the workers {', '.join(blind)}")


def _sees(token: str) -> bool:
    """On a worker: whether that file is there and its folder can be written."""
    path = Path(token)
    return path.exists() and os.access(path.parent, os.W_OK)

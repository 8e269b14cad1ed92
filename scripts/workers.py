# SPDX-License-Identifier: Apache-2.0
"""The same call over many items: here, on processes of this machine, or on a Dask cluster."""

import ctypes
import importlib
import logging
import os
import signal
import sys
import threading
import time
import uuid
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, TypeVar

import joblib
from joblib.externals.loky.process_executor import TerminatedWorkerError

from scripts.options import whole
from slam import locks
from slam.errors import InvalidValueError, MissingDependencyError, MobiliaError, OutputError
from slam.files import write_text
from slam.guests import wire
from slam.names import load, loaded

MAX_JOBS = 1024
WORKERS_TIMEOUT_S = 30
_LOOK_S = 0.25  # between a worker's looks at its parent
_PDEATHSIG = 1  # linux/prctl.h
_TRACKER = "ignore::UserWarning:joblib.externals.loky.backend.resource_tracker"
# A worker that has grown by 300 MB is replaced by a new one between two jobs: nothing is lost, and
# nothing is left to do. loky warns of it all the same.
_REPLACED = "A worker stopped while some jobs were given to the executor"
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
    shared   folder that they write to: on a cluster every worker must see it, which is checked
             before anything starts; where it is locked (``slam.locks``) jobs hold on to it

    ``call`` must be a function of a module. An error of ours stops everything and is raised here.
    When this process is killed, its workers here end at once; those of a cluster end their jobs.
    """
    check_jobs(jobs)
    if cluster is None and (jobs == 1 or len(items) < 2):
        yield from map(call, items)
        return
    with ExitStack() as stack:
        if cluster is None:
            backend = _processes(stack, min(jobs, max(len(items), 1)))
        else:
            backend = _cluster(stack, cluster, shared)
        stack.enter_context(joblib.parallel_config(**backend))
        parallel = joblib.Parallel(return_as="generator_unordered", batch_size=1)
        held = (shared, locks.ticket(shared)) if shared is not None else None
        modules = loaded()
        results = parallel(joblib.delayed(_guarded)(call, item, held, modules) for item in items)
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
            if shared is not None:
                locks.idle(shared)


def _processes(stack: ExitStack, jobs: int) -> dict[str, Any]:
    """Worker processes of this machine, guarded until ``stack`` ends; as joblib takes it."""
    warnings.filterwarnings("ignore", _REPLACED, UserWarning)  # from a thread of loky
    stack.enter_context(wire.guarded_workers())
    if _TRACKER not in sys.warnoptions:  # handed to the tracker of semaphores: what it
        sys.warnoptions.append(_TRACKER)  # finds left over, it removes without a word
    return {
        "backend": "loky",
        "n_jobs": jobs,
        "initializer": end_with_parent,
        "initargs": (os.getpid(),),
    }


def _cluster(stack: ExitStack, address: str, shared: Path | None) -> dict[str, Any]:
    """The workers of a Dask scheduler, connected until ``stack`` ends; as joblib takes it."""
    client = stack.enter_context(_client(address))
    stack.enter_context(_attended(client, address))
    if shared is not None:
        _check_shared(client, shared)
    return {"backend": "dask", "wait_for_workers_timeout": WORKERS_TIMEOUT_S}


@contextmanager
def _attended(client: Any, address: str) -> Iterator[None]:
    """``MobiliaError`` where the scheduler has gone, whatever the libraries make of that."""
    try:
        yield
    except MobiliaError:
        raise
    except Exception as error:
        if client.status == "running":
            raise
        raise MobiliaError(
            f"the Dask scheduler at {address} has gone; with another one, the same command again "
            "goes on from here"
        ) from error


def check_jobs(jobs: int) -> None:
    """``InvalidValueError`` for a number of processes that cannot be."""
    whole("--jobs", jobs, 1, MAX_JOBS)


def _guarded(
    call: Callable[[T], R], item: T, held: tuple[Path, str] | None, modules: tuple[str, ...]
) -> tuple[R | None, MobiliaError | None]:
    """Errors as values: as exceptions they would come back wrapped in a worker's traceback."""
    try:
        load(modules)
        with locks.working(*held) if held is not None and held[1] else nullcontext():
            return call(item), None
    except MobiliaError as error:
        return None, error


def end_with_parent(parent: int) -> None:
    """In a new worker: it ends when the process ``parent`` does, be that by SIGKILL.

    On Linux the kernel kills it, whatever it is doing; before it comes to this, a guard does.
    Elsewhere, and for a worker whose parent started it from another thread than the first, a thread
    here does when it next gets its turn.
    """
    if _of_the_first_thread(parent):  # else the end of that thread would be taken for the parent's
        ctypes.CDLL(None).prctl(_PDEATHSIG, ctypes.c_ulong(signal.SIGKILL), 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _of_the_first_thread(parent: int) -> bool:
    with suppress(OSError):  # no Linux, or one that does not tell
        children = Path(f"/proc/{parent}/task/{parent}/children").read_text()
        return str(os.getpid()) in children.split()
    return False


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_S)
    os._exit(1)


def _client(address: str) -> Any:
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise MissingDependencyError(
            "--cluster needs Dask: pip install 'mobilia[cluster]'"
        ) from error
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # here it is said in a line
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

"""Dask: connect to a running scheduler, or start one with workers on this machine for the time of a render."""

import logging
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import Any

from framearray_cli.base.errors import JobError
from framearray_cli.base.extras import extra

PATIENCE = 5.0  # seconds in which a scheduler must answer
SILENT = logging.CRITICAL + 1


def require_dask() -> Any:
    """Import Dask distributed and silence its log.

    Raises:
        MissingExtraError: Dask distributed is not installed.
    """
    with extra("--workers and --dask need Dask distributed", "[dask]"):
        import distributed
    for name in list(logging.root.manager.loggerDict):  # this program reports what matters, in its own words
        if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(SILENT)
    return distributed


@contextmanager
def connect(address: str) -> Iterator[Any]:
    """Connect a client to a scheduler.

    Raises:
        JobError: no scheduler answers at that address.
    """
    distributed = require_dask()
    found: SimpleQueue[Any] = SimpleQueue()

    def open_client() -> None:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found.put(distributed.Client(address, timeout=PATIENCE, set_as_default=False))
        except Exception as error:  # of any kind, if something other than a scheduler answers
            found.put(error)

    # Dask's own timeout does not hold if something other than a scheduler answers
    threading.Thread(target=open_client, name="connect", daemon=True).start()
    try:
        client = found.get(timeout=PATIENCE + 1.0)
    except Empty:
        client = TimeoutError()
    if isinstance(client, Exception):
        late = isinstance(client, OSError | MemoryError)  # Dask reads the answer of another program as a huge message
        why = f"none answered within {PATIENCE:.0f} s" if late else str(client)
        wanted = 'expected the address of a Dask scheduler, such as "tcp://host:8786"'
        raise JobError(f"--dask {address}", [f"{wanted}; {why}"]) from client
    try:
        yield client
    finally:
        _close(client)


@contextmanager
def start_local(workers: int) -> Iterator[Any]:
    """Start a scheduler with worker processes on this machine and connect a client; workers that die are replaced."""
    distributed = require_dask()
    from .worker import IgnoreSignals

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cluster = distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=0,  # chunks have a limit of their own; Dask would kill a worker above its limit
            dashboard_address=None,
            host="127.0.0.1",
            silence_logs=SILENT,
        )
        try:
            client = distributed.Client(cluster, set_as_default=False)
            client.register_plugin(IgnoreSignals())
            yield client
        finally:
            with suppress(NameError):
                _close(client)
            cluster.close(timeout=PATIENCE)


def _close(client: Any) -> None:
    with suppress(OSError, TimeoutError):
        client.close(timeout=PATIENCE)

"""Runs cases in this process, on local workers or on any Dask cluster: same rows everywhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any

from eddyscan.core.errors import WorkError

Row = dict[str, Any]
CaseFunction = Callable[[Any, Sequence[Mapping[str, Any]]], list[Row]]
Batch = Sequence[Mapping[str, Any]]
MAX_BATCH = 25
RETRIES = 3
KEPT_BYTES = 256 * 2**20  # Dask's 64 KiB makes glibc map and unmap every array anew: a third of a case's CPU time
DASK_SETTINGS = {
    "distributed.scheduler.allowed-failures": 10,
    "distributed.comm.timeouts.connect": "10s",
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": KEPT_BYTES,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": KEPT_BYTES,
}
WORKER_MEMORY = "2GiB"
REACH_TIMEOUT_S = 10


def run_batches(
    function: CaseFunction,
    shared: Any,
    cases: Sequence[Mapping[str, Any]],
    *,
    workers: int = 1,
    scheduler: str | None = None,
    say: Callable[[str], None] | None = None,
) -> Iterator[list[Row]]:
    """Yield the rows of finished batches, in the order they finish.

    Parameters
    ----------
    function : callable
        ``function(shared, batch) -> rows``; pure, importable on the workers.
    shared : object
        What every case needs (tables, technique): sent to each worker once.
    cases : sequence of mappings
    workers : number of local processes; 1 runs here
    scheduler : "tcp://host:port" of a Dask cluster, instead of local workers
    say : takes the dashboard's address

    Raises
    ------
    WorkError
        When the scheduler cannot be reached, speaks another version, or is lost,
        or when cases keep killing their workers.
    """
    batches = _batches(cases, workers)
    if workers == 1 and scheduler is None:
        for batch in batches:
            yield function(shared, batch)
        return
    with _client(workers, scheduler) as client:
        if say is not None:
            say(f"dashboard: {client.dashboard_link}")
        yield from _on_cluster(client, function, shared, batches)


def _batches(cases: Batch, workers: int) -> list[Batch]:
    size = max(1, min(MAX_BATCH, len(cases) // (8 * max(workers, 1)) or 1))
    return [cases[start : start + size] for start in range(0, len(cases), size)]


def _on_cluster(client: Any, function: CaseFunction, shared: Any, batches: Sequence[Batch]) -> Iterator[list[Row]]:
    """Yield rows; what the last holder of the shared tables took down with it is sent again."""
    from distributed.comm import CommClosedError

    pending = dict(enumerate(batches))
    for _ in range(RETRIES):
        try:
            yield from _one_round(client, function, shared, pending)
        except (OSError, TimeoutError) as error:
            if client.status == "running" and not isinstance(error, CommClosedError):
                raise  # the case's own fault, not the cluster's
            raise _lost(error) from error
        if not pending:
            return
        if client.status != "running":
            break
    raise _lost(RuntimeError(f"{len(pending)} batches were cancelled"))


def _one_round(client: Any, function: CaseFunction, shared: Any, pending: dict[int, Batch]) -> Iterator[list[Row]]:
    """Submit what is pending and take finished batches out of it; stop early when the cluster cancels them."""
    from distributed import KilledWorker, as_completed
    from distributed.client import FutureCancelledError

    remote = client.scatter(shared, broadcast=True, hash=False)
    futures = {
        client.submit(function, remote, batch, pure=False, retries=RETRIES): number for number, batch in pending.items()
    }
    try:
        for future in as_completed(list(futures)):
            rows = future.result()
            del pending[futures[future]]
            future.release()
            yield rows
    except FutureCancelledError:
        return
    except KilledWorker as error:
        raise WorkError(
            f"some cases killed every worker they ran on ({error}). Rows that came in are kept. "
            f"Give the workers more memory than {WORKER_MEMORY}, or leave those cases out."
        ) from error


def _lost(error: Exception) -> WorkError:
    return WorkError(
        f"the Dask scheduler was lost ({type(error).__name__}: {error}); rows that came in are kept. "
        "Start it again and repeat the command: it goes on with what is missing."
    )


@contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Any]:
    import dask
    from distributed import Client, LocalCluster

    with dask.config.set(DASK_SETTINGS):
        if scheduler is not None:
            with _reached(scheduler) as client:
                yield client
            return
        with (
            LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                memory_limit=WORKER_MEMORY,
                host="127.0.0.1",
                dashboard_address=":0",
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client


def _reached(scheduler: str) -> Any:
    """Return a client of a cluster that has workers with this eddyscan; else raise WorkError."""
    from distributed import Client

    client = None
    try:
        client = Client(scheduler, timeout=REACH_TIMEOUT_S)
        client.get_versions(check=True)
        client.wait_for_workers(1, timeout=REACH_TIMEOUT_S)
        there, here = set(client.run(_eddyscan_version).values()), _eddyscan_version()
        if there != {here}:
            raise ValueError(f"its workers have eddyscan {', '.join(sorted(there))}, here is {here}")
    except (OSError, TimeoutError, ValueError, ImportError) as error:
        if client is not None:
            client.close()
        raise WorkError(
            f"no usable Dask scheduler at {scheduler}: {error}. Start one with `dask scheduler` and workers with "
            "`dask worker`, with the same eddyscan and dask versions on scheduler, workers and here."
        ) from error
    return client


def _eddyscan_version() -> str:
    return version("eddyscan")

"""Runs cases in this process, on local workers or on any Dask cluster: same rows everywhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from eddyscan.core.errors import WorkError

Row = dict[str, Any]
CaseFunction = Callable[[Any, Sequence[Mapping[str, Any]]], list[Row]]
MAX_BATCH = 25
RETRIES = 3


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
        When the scheduler cannot be reached, speaks another version, or is lost.
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


def _batches(cases: Sequence[Mapping[str, Any]], workers: int) -> list[Sequence[Mapping[str, Any]]]:
    size = max(1, min(MAX_BATCH, len(cases) // (8 * max(workers, 1)) or 1))
    return [cases[start : start + size] for start in range(0, len(cases), size)]


def _on_cluster(
    client: Any, function: CaseFunction, shared: Any, batches: Sequence[Sequence[Mapping[str, Any]]]
) -> Iterator[list[Row]]:
    from distributed import as_completed
    from distributed.client import FutureCancelledError

    remote = client.scatter(shared, broadcast=True, hash=False)
    futures = [client.submit(function, remote, batch, pure=False, retries=RETRIES) for batch in batches]
    try:
        for future in as_completed(futures):
            yield future.result()
            future.release()
    except (OSError, TimeoutError, FutureCancelledError) as error:
        raise WorkError(
            f"the Dask scheduler was lost ({type(error).__name__}); rows that came in are kept. "
            "Start it again and repeat the command: it goes on with what is missing."
        ) from error


@contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Any]:
    import dask
    from distributed import Client, LocalCluster

    dask.config.set({"distributed.scheduler.allowed-failures": 10, "distributed.comm.timeouts.connect": "10s"})
    if scheduler is None:
        with (
            LocalCluster(
                n_workers=workers, threads_per_worker=1, memory_limit="2GiB", host="127.0.0.1", dashboard_address=":0"
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client
        return
    try:
        client = Client(scheduler, timeout="10s")
        client.get_versions(check=True)
    except (OSError, TimeoutError, ValueError) as error:
        raise WorkError(
            f"no usable Dask scheduler at {scheduler}: {error}. Start one with `dask scheduler`, with the same "
            "eddyscan and dask versions on scheduler, workers and here."
        ) from error
    with client:
        yield client

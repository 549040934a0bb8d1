"""Connects to a cluster: a Dask client, an address, or local worker processes."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from renderer.errors import ClusterError
from renderer.process import memory

if TYPE_CHECKING:
    from renderer.rendering.cluster.source import ClusterWorkers

CONNECT = 10  # [s]
_OF_PROCESS = 160 << 20  # [bytes] of a worker after its imports
MISSING = "a cluster needs Dask: pip install 'lightproof[cluster]'"


def workers_of(cluster: Any) -> ClusterWorkers:
    """Return the workers of a `distributed.Client`, or a `ClusterWorkers` unchanged.

    Raises
    ------
    TypeError
        If it is something else, or an asynchronous client.
    ClusterError
        If Dask is not installed.
    """
    _check_dask()
    from distributed import Client

    from renderer.rendering.cluster.source import ClusterWorkers

    if isinstance(cluster, ClusterWorkers):
        return cluster
    if not isinstance(cluster, Client) or cluster.asynchronous:
        raise TypeError(
            f"the cluster is of type {type(cluster).__name__}; possible is a "
            "distributed.Client that is not asynchronous"
        )
    return ClusterWorkers(cluster)


@contextmanager
def open_cluster(where: str) -> Iterator[ClusterWorkers]:
    """Start a local cluster (`local:4`), or connect to one (`tcp://host:8786`).

    A local cluster has the given number of processes with one thread each. It ends with the
    context.

    Raises
    ------
    NotAllowed
        If the processes alone, without a scene, need more memory than is available.
    ClusterError
        If there is no cluster at that address, or Dask is not installed.
    """
    _check_dask()
    # errors are reported by this program, in one line
    logging.getLogger("distributed").setLevel(logging.CRITICAL + 1)
    if where.startswith("local:"):
        with _local(int(where.removeprefix("local:"))) as found:
            yield found
        return
    from distributed import Client

    from renderer.rendering.cluster.source import ClusterWorkers

    try:
        client = Client(where, set_as_default=False, timeout=CONNECT)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise ClusterError(f"no cluster at {where}: {reason}") from None
    with client:
        yield ClusterWorkers(client)


@contextmanager
def _local(workers: int) -> Iterator[ClusterWorkers]:
    from distributed import Client, LocalCluster

    from renderer.rendering.cluster.source import ClusterWorkers

    # checked before they start: two hundred processes block a machine for minutes
    memory.require(workers * _OF_PROCESS, f"--cluster local:{workers}: a process for each")
    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # any free port; a fixed one may be in use
            silence_logs=logging.CRITICAL + 1,
            preload=["renderer.rendering.cluster.worker"],  # calls its `dask_setup`
            memory_limit=0,  # Dask's monitor would end workers; ours need little memory
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield ClusterWorkers(client, workers)


def _check_dask() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise ClusterError(MISSING) from None

"""From what a user calls a cluster to its workers: a client of Dask's, or an address."""

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
_OF_PROCESS = 160 << 20  # [bytes] of a worker that has imported what it needs
MISSING = "a cluster needs Dask: pip install 'lightproof[cluster]'"


def workers_of(cluster: Any) -> ClusterWorkers:
    """Return the workers of a `distributed.Client`, or workers as they are.

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
    """Start a cluster, `local:4`, or connect to one, `tcp://host:8786`.

    A local one has so many processes of one thread each, and ends with the context.

    Raises
    ------
    NotAllowed
        If processes alone, without a scene, take more memory than there is.
    ClusterError
        If there is none at that address, or Dask is not installed.
    """
    _check_dask()
    # what goes wrong is said by us, in one line
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

    # before they start: two hundred of them hold up a machine for minutes
    memory.require(workers * _OF_PROCESS, f"--cluster local:{workers}: a process for each")
    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # any free port; two clusters meet at one else
            silence_logs=logging.CRITICAL + 1,
            preload=["renderer.rendering.cluster.worker"],  # `dask_setup` there
            memory_limit=0,  # a watch that would end workers; ours keep little
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield ClusterWorkers(client, workers)


def _check_dask() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise ClusterError(MISSING) from None

"""Jobs spread over a Ray cluster (the ``ray`` extra): every task minds a child process on the machine it lands on."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Callable, Iterator
from importlib import util
from typing import Any

from react_opt.errors import MissingPartError, ReactError, UsageError

POLL_S = 0.5
REACH_S = 5.0


def spread(
    run_one: Callable[..., Any],
    jobs: list[Any],
    workers: int,
    retries: int,
    cluster: str,
    should_stop: Callable[[], bool],
) -> Iterator[tuple[Any, Any]]:
    """Yield jobs with their records as they come; None for the record of one that the cluster lost.

    Parameters
    ----------
    run_one
        Runs a job, given it and the retries, and returns its record.
    jobs
        The jobs.
    workers
        Jobs at a time on a cluster that is started here.
    retries
        Further attempts where the child process of a job dies; at least one where the cluster loses the Ray worker
        that minds it, or its machine.
    cluster
        ``local``, or an address (``auto`` for the running one).
    should_stop
        Polled.

    Raises
    ------
    MissingPartError
        Where Ray is not installed.
    UsageError
        Where a job needs more cores than any machine has.
    ReactError
        Where the cluster cannot be reached, or its machines cannot run the jobs.
    """
    if util.find_spec("ray") is None:
        raise MissingPartError("a Ray cluster needs ray: pip install 'react_opt[ray]'")
    import ray

    cores = max((job.cores for job in jobs), default=1)
    mine = not ray.is_initialized()
    if mine:
        _join(cluster, workers * cores)
    lost = (
        ray.exceptions.WorkerCrashedError,
        ray.exceptions.NodeDiedError,
        ray.exceptions.LocalRayletDiedError,
        ray.exceptions.OutOfMemoryError,
    )
    try:
        most = max(node["Resources"].get("CPU", 0) for node in ray.nodes() if node["Alive"])
        if cores > most:
            raise UsageError(
                f"a job needs {cores} cores: no machine of the Ray cluster {cluster!r} has more than {most:g}"
            )
        task = ray.remote(max_retries=max(1, retries))(run_one)  # a lost machine says nothing of the job
        pending = {task.options(num_cpus=job.cores).remote(job, retries): job for job in jobs}
        while pending:
            ready, _ = ray.wait(list(pending), timeout=POLL_S)
            for reference in ready:
                try:
                    record = ray.get(reference)
                except lost:
                    record = None
                except ray.exceptions.RayError as error:  # such as a machine without this package
                    said = str(error).strip().splitlines()
                    raise ReactError(
                        f"the Ray cluster {cluster!r} cannot run jobs: {said[-1] if said else error}"
                    ) from None
                yield pending.pop(reference), record
            if should_stop():
                for reference in pending:
                    ray.cancel(reference, force=True)
                return
    finally:
        if mine:
            ray.shutdown()


def _join(cluster: str, cores: int) -> None:
    """Connect to a cluster, or start one with so many cores here."""
    import ray

    try:
        if cluster == "local":
            paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
            ray.init(
                num_cpus=cores, include_dashboard=False, log_to_driver=False, logging_level="ERROR",
                runtime_env={"env_vars": {"PYTHONPATH": paths}},
            )  # fmt: skip
        else:
            host, colon, port = cluster.rpartition(":")
            if colon and port.isdigit() and "//" not in host:  # Ray itself would try for minutes
                socket.create_connection((host, int(port)), timeout=REACH_S).close()
            ray.init(address=cluster, log_to_driver=False, logging_level="ERROR")
    except (OSError, ValueError, ImportError, RuntimeError) as error:
        raise ReactError(f"the Ray cluster {cluster!r} cannot be reached: {_last_line(error)}") from None


def _last_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[-1]

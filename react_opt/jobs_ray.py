"""Jobs spread over a Ray cluster (the ``ray`` extra): every task minds a child process on the machine it lands on."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from importlib import util
from typing import Any

from react_opt.errors import MissingPartError, ReactError

POLL_S = 0.5


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
        Places of a cluster that is started here.
    retries
        Further attempts where a process or a machine dies.
    cluster
        ``local``, or an address (``auto`` for the running one).
    should_stop
        Polled.

    Raises
    ------
    MissingPartError
        Where Ray is not installed.
    ReactError
        Where the cluster cannot be reached.
    """
    if util.find_spec("ray") is None:
        raise MissingPartError("a Ray cluster needs ray: pip install 'react_opt[ray]'")
    import ray

    mine = not ray.is_initialized()
    if mine:
        try:
            if cluster == "local":
                paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
                ray.init(
                    num_cpus=workers, include_dashboard=False, log_to_driver=False, logging_level="ERROR",
                    runtime_env={"env_vars": {"PYTHONPATH": paths}},
                )  # fmt: skip
            else:
                ray.init(address=cluster, log_to_driver=False, logging_level="ERROR")
        except (ConnectionError, ValueError) as error:
            raise ReactError(f"the Ray cluster {cluster!r} cannot be reached: {error}") from None
    try:
        task = ray.remote(num_cpus=1, max_retries=retries)(run_one)
        pending = {task.remote(job, retries): job for job in jobs}
        while pending:
            ready, _ = ray.wait(list(pending), timeout=POLL_S)
            for reference in ready:
                try:
                    record = ray.get(reference)
                except (ray.exceptions.WorkerCrashedError, ray.exceptions.NodeDiedError):
                    record = None
                yield pending.pop(reference), record
            if should_stop():
                for reference in pending:
                    ray.cancel(reference, force=True)
                return
    finally:
        if mine:
            ray.shutdown()

"""Many jobs, each in a process of its own, that survive crashes and go on where they were stopped.

A :class:`Job` names a function and its arguments. :func:`run_jobs` runs each in a child process with limits on time
and memory and appends one line per finished job to a results file; called again with the same file it skips what is
finished. The same jobs spread over a Ray cluster with ``cluster="auto"``::

    jobs = [Job(f"seed {s}", "campaign:mission", {"seed": s}, time_limit_s=60) for s in range(1000)]
    records = run_jobs(jobs, "missions.jsonl", workers=2, reuse=50)
"""

from __future__ import annotations

import platform
import queue
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from os import PathLike
from typing import Any, Literal

from react_opt.errors import UsageError
from react_opt.jobs_file import append, opened
from react_opt.jobs_worker import Worker

Ending = Literal["done", "failed", "time", "memory", "died"]
POLL_S = 0.05


@dataclass(frozen=True)
class Job:
    """A piece of work.

    Parameters
    ----------
    key
        Its name, unique among the jobs of a file: a key whose job has ended is not run again.
    target
        ``module:function``, called in the child process as ``function(**arguments)``; what it returns must be
        writable as JSON.
    arguments
        Arguments, writable as JSON.
    time_limit_s
        The process is killed after so many seconds of wall time, its start included; None for never.
    memory_limit_mb
        It is killed when it and its children hold more resident memory, MB (10^6 bytes); None for never.
    cores
        Cores that it keeps busy: what a Ray cluster sets aside for it. On this machine ``workers`` decides.
    """

    key: str
    target: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    time_limit_s: float | None = None
    memory_limit_mb: float | None = None
    cores: int = 1


@dataclass(frozen=True)
class Record:
    """How a job ended: one line of a results file.

    Parameters
    ----------
    key
        Its key.
    ending
        ``done``; ``failed`` (it raised); ``time`` or ``memory`` (killed at that limit); ``died`` (its process ended
        by itself, on every attempt).
    result
        What the function returned; None unless done.
    error
        Why it did not end well, in one line.
    wall_s, cpu_s
        Wall and processor time of the last attempt, s, children of the process included.
    peak_mb
        Most resident memory that was seen of the process and its children together, MB.
    attempts
        How often it was begun.
    host
        The machine it ran on.
    """

    key: str
    ending: Ending
    result: Any = None
    error: str = ""
    wall_s: float = 0.0
    cpu_s: float = 0.0
    peak_mb: float = 0.0
    attempts: int = 1
    host: str = ""


def run_jobs(
    jobs: Sequence[Job],
    file: str | PathLike[str],
    *,
    workers: int = 1,
    reuse: int = 1,
    retries: int = 1,
    cluster: str | None = None,
    header: Mapping[str, Any] | None = None,
    on_record: Callable[[Record], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> list[Record]:
    """Run what is not finished, and return the records of all jobs that are, in the order of the jobs.

    Parameters
    ----------
    jobs
        The jobs; their keys differ.
    file
        Results as JSON lines. Each line is written at once and flushed to disk; half a line that a kill left behind
        is cut off. One process at a time works on a file.
    workers
        Jobs at a time on this machine.
    reuse
        Jobs that one child process serves before a new one takes its place: 1 measures each job's memory and start
        alone, more saves loading libraries. A process that was killed or died is never used again.
    retries
        Further attempts at a job whose process died by itself. A job that raised, or was killed at a limit, would
        do so again and is not repeated. One that a cluster lost with its machine is tried at least once more.
    cluster
        None for this machine; else the address of a Ray cluster (``auto`` for the one there is, ``local`` to start
        one here for ``workers`` jobs at a time), whose machines must have the same packages installed and find the
        files that arguments name under the same paths. ``reuse`` is 1 there.
    header
        Written as a line of its own before the first new record, with the time in ``begun``. Where it has a ``kind``,
        a file that begins with another one is refused.
    on_record
        Called with each new record, in the calling thread.
    should_stop
        Polled; True ends the running jobs without a record, so that they run again next time.

    Raises
    ------
    UsageError
        Where keys repeat, another process works on the file, or no machine of a cluster has a job's cores.
    InputError
        Where the file cannot be read or written, or holds something else.
    MissingPartError
        Where a cluster is asked for and Ray is not installed.
    ReactError
        Where the cluster cannot be reached, or its machines cannot run the jobs.
    """
    keys = [job.key for job in jobs]
    if len(set(keys)) < len(keys):
        raise UsageError(f"jobs: expected different keys, found {next(k for k in keys if keys.count(k) > 1)!r} twice")
    if workers < 1 or reuse < 1:
        raise UsageError("jobs: expected at least one worker and one job per process")
    with opened(file, None if header is None else header.get("kind")) as (handle, lines):
        found = {line["key"]: Record(**line) for line in lines if "ending" in line}
        waiting = [job for job in jobs if job.key not in found]
        if waiting and header is not None:
            append(handle, {**header, "begun": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())})
        run = _run_here if cluster is None else _run_on_ray
        for record in run(waiting, workers, reuse, retries, cluster, should_stop or (lambda: False)):
            append(handle, asdict(record))
            found[record.key] = record
            if on_record is not None:
                on_record(record)
    return [found[key] for key in keys if key in found]


def run_one(job: Job, retries: int = 0) -> Record:
    """Run a job in a child process of its own and return how it ended."""
    place = _Place(reuse=1, retries=retries)
    try:
        record = place.run(job, threading.Event())
    finally:
        place.close()
    assert record is not None
    return record


class _Place:
    """Where one job at a time runs: a child process, replaced when it has served its share or is no more."""

    def __init__(self, reuse: int, retries: int) -> None:
        self._reuse, self._retries = reuse, retries
        self._worker: Worker | None = None
        self._served = 0

    def run(self, job: Job, stop: threading.Event) -> Record | None:
        """Return how a job ended; None where it was stopped."""
        record = None
        for attempt in range(1, self._retries + 2):
            record = _attempt(job, self._next(), attempt, stop)
            if record is None or record.ending != "died":
                break
        return record

    def close(self) -> None:
        """Let the child process go."""
        if self._worker is not None:
            self._worker.end()
            self._worker = None

    def _next(self) -> Worker:
        if self._worker is not None and (self._served == self._reuse or not self._worker.alive()):
            self.close()
        if self._worker is None:
            self._worker, self._served = Worker(), 0
        self._served += 1
        return self._worker


def _attempt(job: Job, worker: Worker, attempt: int, stop: threading.Event) -> Record | None:
    """Run a job once in a worker; None where it was told to stop."""
    begun = time.perf_counter()
    worker.send(job.target, dict(job.arguments))
    ending: Ending | None = None
    result, error = None, ""
    while ending is None:
        answer = worker.receive(POLL_S)
        memory_mb = worker.measure()
        if answer is not None:
            ending, result, error = ("done", answer[1], "") if answer[0] else ("failed", None, str(answer[1]))
        elif not worker.alive():
            ending, error = "died", worker.last_words()
        elif job.time_limit_s is not None and time.perf_counter() - begun > job.time_limit_s:
            ending, error = "time", f"killed after {job.time_limit_s:g} s"
        elif job.memory_limit_mb is not None and memory_mb > job.memory_limit_mb:
            ending, error = "memory", f"killed above {job.memory_limit_mb:g} MB"
        elif stop.is_set():
            worker.kill()
            return None
    wall_s, cpu_s = round(time.perf_counter() - begun, 4), round(worker.cpu_s(), 3)
    if ending in ("time", "memory"):
        worker.kill()
    return Record(job.key, ending, result, error, wall_s, cpu_s, round(worker.peak_mb, 1), attempt, platform.node())


def _run_here(
    jobs: list[Job], workers: int, reuse: int, retries: int, _: str | None, should_stop: Callable[[], bool]
) -> Iterator[Record]:
    """Yield records as they come; a thread per place minds one child process after the other."""
    todo: queue.SimpleQueue[Job] = queue.SimpleQueue()
    for job in jobs:
        todo.put(job)
    done: queue.SimpleQueue[Record | BaseException | None] = queue.SimpleQueue()
    stop = threading.Event()
    places = min(workers, len(jobs))
    threads = [
        threading.Thread(target=_mind, args=(todo, done, _Place(reuse, retries), stop), daemon=True)
        for _ in range(places)
    ]
    for thread in threads:
        thread.start()
    try:
        while places:
            try:
                record = done.get(timeout=0.1)
            except queue.Empty:
                if should_stop():
                    return
                continue
            if record is None:
                places -= 1
            elif isinstance(record, BaseException):
                raise record
            else:
                yield record
    finally:
        stop.set()
        for thread in threads:
            thread.join()


def _mind(
    todo: queue.SimpleQueue[Job],
    done: queue.SimpleQueue[Record | BaseException | None],
    place: _Place,
    stop: threading.Event,
) -> None:
    try:
        while not stop.is_set():
            record = place.run(todo.get_nowait(), stop)
            if record is not None:
                done.put(record)
    except queue.Empty:
        pass
    except BaseException as error:  # raised again where the records are awaited
        done.put(error)
    finally:
        place.close()
        done.put(None)


def _run_on_ray(
    jobs: list[Job], workers: int, reuse: int, retries: int, cluster: str | None, should_stop: Callable[[], bool]
) -> Iterator[Record]:
    """Yield records as they come from a Ray cluster; every machine minds its own child processes."""
    from react_opt.jobs_ray import spread

    for job, record in spread(run_one, jobs, workers, retries, str(cluster), should_stop):
        yield record or Record(job.key, "died", error="the cluster lost the machine that it ran on")

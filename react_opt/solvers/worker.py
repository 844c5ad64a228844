"""Solvers run in a process of their own: nothing they do can hold the caller, and no two libraries meet in one.

A worker is started at its first use and serves one solve after the other; where a solver does not stop, its process
is killed, and what it had found by then has already been told.
"""

from __future__ import annotations

import atexit
import os
import queue
import subprocess
import sys
import tempfile
import threading
from dataclasses import dataclass, field, replace
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from time import monotonic, perf_counter
from typing import Any

from react_opt.errors import ReactError
from react_opt.models.program import Program
from react_opt.solvers.outcome import Claim, Request
from react_opt.solvers.watch import FloatArray, Watch

_BOOT = "import sys; from react_opt.solvers.worker import serve; serve(int(sys.argv[1]), sys.argv[2])"
_POLL_S = 0.02
_KILL_GRACE_S = 0.3
_EXIT_GRACE_S = 0.5


@dataclass
class _Worker:
    """The caller's end of a worker process."""

    target: str
    process: subprocess.Popen[bytes]
    connection: Connection[Any, Any]
    errors: Any
    owner: int = field(default_factory=os.getpid)

    @classmethod
    def start(cls, target: str) -> _Worker:
        ours, theirs = Pipe()
        errors = tempfile.TemporaryFile()  # noqa: SIM115  (lives as long as the worker)
        paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
        process = subprocess.Popen(
            [sys.executable, "-c", _BOOT, str(theirs.fileno()), target],
            env={**os.environ, "PYTHONPATH": paths},
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,  # an interrupt of the terminal is the caller's to handle
        )
        theirs.close()
        return cls(target, process, ours, errors)

    def last_words(self) -> str:
        self.errors.seek(0)
        lines = self.errors.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else "without a word"

    def end(self, grace_s: float) -> None:
        self.connection.close()  # the worker leaves when its line goes dead
        try:
            self.process.wait(grace_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.errors.close()


_idle: list[_Worker] = []
_guard = threading.Lock()


def run_in_worker(target: str, args: tuple[str, ...], program: Program, request: Request, watch: Watch) -> Claim:
    """Run ``target`` in a worker process and return its claim.

    Parameters
    ----------
    target
        ``module:function``, called as ``function(program, request, watch, *args)`` in the worker.
    args
        Further arguments.
    program, request
        What to solve, and how; the callbacks of the request stay here.
    watch
        Gets what the worker finds, and tells it to stop.

    Raises
    ------
    ReactError
        What the function raised on purpose; that it failed otherwise is a note of the claim.
    """
    worker = _take(target)
    kept = False
    watch.on_leave = worker.process.kill
    try:
        left_s = watch.remaining_s()
        deadline = None if left_s is None else monotonic() + left_s
        worker.connection.send((program, replace(request, on_progress=None, should_stop=None), deadline, args))
        claim, kept = _converse(worker, watch), True
        return claim
    except TimeoutError:
        return Claim("no_solution", notes=["the solver had not stopped in time and was killed"])
    except (EOFError, ConnectionError):
        code = worker.process.wait()
        return Claim(
            "no_solution", notes=[f"the solver's process ended by itself (code {code}): {worker.last_words()}"]
        )
    except ReactError:
        kept = True
        raise
    finally:
        watch.on_leave = None
        if kept:
            with _guard:
                _idle.append(worker)
        else:
            worker.process.kill()
            worker.end(_EXIT_GRACE_S)


def _converse(worker: _Worker, watch: Watch) -> Claim:
    """Listen to a worker until it has answered; raise TimeoutError where it does not stop when told to."""
    told: float | None = None
    while True:
        if worker.connection.poll(_POLL_S):
            kind, content = worker.connection.recv()
            if kind == "found":
                watch.found(*content)
            elif kind == "proved":
                watch.proved(content)
            elif kind == "raised":
                raise content
            else:
                claim: Claim = content
                return claim
        elif watch.stopped():
            if told is None:
                told = perf_counter()
                worker.connection.send("stop")
            elif perf_counter() - told > _KILL_GRACE_S:
                raise TimeoutError


def _take(target: str) -> _Worker:
    with _guard:
        _idle[:] = [worker for worker in _idle if worker.owner == os.getpid() and worker.process.poll() is None]
        for worker in _idle:
            if worker.target == target:
                _idle.remove(worker)
                return worker
    return _Worker.start(target)


@atexit.register
def _end_idle() -> None:
    for worker in _idle:
        if worker.owner == os.getpid():
            worker.end(_EXIT_GRACE_S)


# --- in the worker ---


@dataclass
class _TellingWatch(Watch):
    """A watch that tells the caller what is recorded."""

    tell: Any = None

    def found(self, x: FloatArray, objective: float) -> None:
        """Record a solution, and tell it where it is the best so far."""
        before = self.objective
        super().found(x, objective)
        if self.objective != before:
            self.tell(("found", (self.x, self.objective)))

    def proved(self, bound: float) -> None:
        """Record a bound, and tell it where it is the tightest so far."""
        before = self.bound
        super().proved(bound)
        if self.bound != before:
            self.tell(("proved", self.bound))


def serve(handle: int, target: str) -> None:
    """Serve solves until the caller hangs up; the main function of a worker process.

    Parameters
    ----------
    handle
        File descriptor of the line to the caller.
    target
        ``module:function`` to run.
    """
    connection: Connection[Any, Any] = Connection(handle)
    speaking = threading.Lock()
    jobs: queue.Queue[Any] = queue.Queue()
    current: list[Watch] = []

    def tell(message: Any) -> None:
        with speaking:
            connection.send(message)

    def listen() -> None:
        try:
            while True:
                message = connection.recv()
                if message == "stop":
                    current[0].stop("interrupt")
                    continue
                program, request, deadline, args = message
                left = None if deadline is None else perf_counter() + deadline - monotonic()
                current[:] = [_TellingWatch(program.maximise, left, tell=tell)]
                jobs.put((program, request, current[0], args))
        except (EOFError, OSError):
            os._exit(0)

    module, name = target.split(":")
    run = getattr(import_module(module), name)
    threading.Thread(target=listen, daemon=True).start()
    while True:
        program, request, watch, args = jobs.get()
        tell(_answer(run, program, request, watch, args))


def _answer(run: Any, program: Program, request: Request, watch: Watch, args: tuple[str, ...]) -> tuple[str, Any]:
    try:
        claim: Claim = run(program, request, watch, *args)
    except ReactError as error:
        return "raised", error
    except MemoryError:
        return "claim", Claim("no_solution", limit="memory")
    except Exception as error:
        # Whatever goes wrong in a library, what it had told by then and the start are still worth having.
        cause = error.__context__ or error
        return "claim", Claim("no_solution", notes=[f"the solver failed: {type(cause).__name__}: {cause}"])
    if claim.limit == "none" and watch.reason == "time":
        claim.limit = "time"
    return "claim", claim

"""A child process that serves jobs: started, measured and killed from here, served by :func:`serve` over there."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import threading
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

import psutil

_BOOT = "import sys; from react_opt.jobs_worker import serve; serve(int(sys.argv[1]))"
_GRACE_S = 1.0
_GONE = (psutil.NoSuchProcess, psutil.AccessDenied, psutil.ZombieProcess)


class Worker:
    """The caller's end of a child process: what it is given, what it answers, what it uses."""

    def __init__(self) -> None:
        self._line, theirs = Pipe()
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115  (lives as long as the process)
        paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
        self._process = subprocess.Popen(
            [sys.executable, "-c", _BOOT, str(theirs.fileno())],
            env={**os.environ, "PYTHONPATH": paths},
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=self._errors,
            stderr=self._errors,
            start_new_session=True,  # an interrupt of the terminal is the caller's to handle
        )
        theirs.close()
        self._watched = psutil.Process(self._process.pid)
        self._cpu_before_s = 0.0
        self._seen_cpu_s: dict[int, float] = {}
        self.peak_mb = 0.0

    def send(self, target: str, arguments: dict[str, Any]) -> None:
        """Give it a job; what it used before no longer counts."""
        self.peak_mb = 0.0
        self.measure()
        self._cpu_before_s = sum(self._seen_cpu_s.values())
        with contextlib.suppress(OSError):  # it died: the caller sees that it is not alive
            self._line.send_bytes(json.dumps([target, arguments]).encode())

    def receive(self, patience_s: float) -> tuple[bool, Any] | None:
        """Return its answer (whether it succeeded, and the result or what went wrong), None where there is none yet."""
        try:
            if self._line.poll(patience_s):
                success, content = json.loads(self._line.recv_bytes())
                self.measure()
                return bool(success), content
        except (EOFError, OSError):
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_GRACE_S)
        return None

    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process.poll() is None

    def measure(self) -> float:
        """Return the resident memory of the process and its children now, MB; remembers the most seen."""
        total_mb = 0.0
        for process in self._tree():
            with contextlib.suppress(*_GONE):
                total_mb += process.memory_info().rss / 1e6
                times = process.cpu_times()
                self._seen_cpu_s[process.pid] = times.user + times.system
        self.peak_mb = max(self.peak_mb, total_mb)
        return total_mb

    def cpu_s(self) -> float:
        """Return the processor time of the job so far, s, as far as it was seen of its children."""
        return max(0.0, sum(self._seen_cpu_s.values()) - self._cpu_before_s)

    def last_words(self) -> str:
        """Return how the process ended, and the last line that it printed."""
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        return f"the process ended with code {self._process.poll()}: {lines[-1][:300] if lines else 'without a word'}"

    def kill(self) -> None:
        """Kill the process and its children."""
        for process in reversed(self._tree()):
            with contextlib.suppress(*_GONE):
                process.kill()
        self._process.wait()

    def end(self) -> None:
        """Let the process go; kill it where it does not."""
        self._line.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_GRACE_S)
        if self.alive():
            self.kill()
        self._errors.close()

    def _tree(self) -> list[psutil.Process]:
        with contextlib.suppress(*_GONE):
            return [self._watched, *self._watched.children(recursive=True)]
        return []


# --- in the child process ---


def serve(handle: int) -> None:
    """Serve jobs until the caller hangs up, which also ends a job that is running; the child's main function.

    Parameters
    ----------
    handle
        File descriptor of the line to the caller.
    """
    line: Connection[Any, Any] = Connection(handle)
    jobs: list[bytes] = []
    come = threading.Semaphore(0)

    def listen() -> None:
        try:
            while True:
                jobs.append(line.recv_bytes())
                come.release()
        except (EOFError, OSError):
            os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    while True:
        come.acquire()
        target, arguments = json.loads(jobs.pop(0))
        line.send_bytes(json.dumps(_answer(target, arguments)).encode())


def _answer(target: str, arguments: dict[str, Any]) -> tuple[bool, Any]:
    try:
        module, name = target.split(":")
        result = getattr(import_module(module), name)(**arguments)
        json.dumps(result, allow_nan=False)
    except Exception as error:  # whatever a job raises is its result; the next one is served all the same
        return False, " ".join(f"{type(error).__name__}: {error}".split())
    return True, result

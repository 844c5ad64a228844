"""A child process for planners that may hang: it is asked one query at a time and killed when it does not answer.

Not a fork: the child is a fresh interpreter, so compiled threads and locks of the parent are no concern. Messages
are pickles behind their length on the child's standard input and a pipe; whatever a library prints goes to
standard error.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import select
import signal
import struct
import subprocess
import sys
import time
import weakref
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import IO, Any

import numpy as np
from scipy import ndimage

from react_opt.errors import ReactError
from react_opt.paths.roadmap import flat_pixels
from react_opt.paths.sampled import FloatArray, Grids

_START_S = 120.0
"""How long the child may take to import everything, on a cold and busy machine."""


class SearchProcess:
    """One planner in a child process, started at the first query and again after a kill.

    Parameters
    ----------
    grids
        Where the robot may stand and drive.
    setup
        Planner, its parameters, iterations and seed, for :func:`react_opt.paths.ompl_.search`; a query's own seed
        also depends on its two ends, and on nothing else.
    patience_s
        How long a query may take before the child is killed.

    Attributes
    ----------
    killed
        How many queries ended with the child's death.
    """

    def __init__(self, grids: Grids, setup: tuple[str, dict[str, float], int, int], patience_s: float) -> None:
        self._grids = grids
        self._setup = setup
        self._patience_s = patience_s
        self._process: subprocess.Popen[bytes] | None = None
        self.killed = 0

    def ask(self, start_px: FloatArray, goal_px: FloatArray) -> FloatArray | None:
        """Return a path between two points in pixel coordinates, None where none was found in time."""
        process = self._process or self._start()
        assert process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # a child that died is one that does not answer
            _send(process.stdin, (start_px, goal_px))
        done, path = _receive(process.stdout, time.monotonic() + self._patience_s)
        if not done:
            self.killed += 1
            _end(process)
            self._process = None
        return path if done else None

    def paths(self, points: FloatArray) -> Iterator[tuple[tuple[int, int], FloatArray]]:
        """Yield ``(i, j)``, i < j, and a path, for every pair of points for which one was found.

        Points in sight of each other are answered at once, and so are points that no search can connect.

        Parameters
        ----------
        points
            ``(n, 2)`` pixel coordinates where the robot may stand.
        """
        grids = self._grids
        regions = np.asarray(ndimage.label(grids.drive == 0)[0], dtype=np.int32).ravel()
        at = regions[flat_pixels(grids.stand, points)]
        for i, j in combinations(range(len(points)), 2):
            if grids.leg_free(points[i], points[j]):
                yield (i, j), points[[i, j]]
            elif at[i] == at[j]:
                path = self.ask(points[i], points[j])
                if path is not None:
                    yield (i, j), path

    def _start(self) -> subprocess.Popen[bytes]:
        here = str(Path(__file__).resolve().parents[2])  # for a package that is on the path but not installed
        process = subprocess.Popen(
            [sys.executable, "-m", "react_opt.paths.ompl_child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (here, os.environ.get("PYTHONPATH"))))},
        )
        weakref.finalize(self, _end, process)
        assert process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            _send(process.stdin, (self._grids, *self._setup))
        ready, fault = _receive(process.stdout, time.monotonic() + _START_S)
        if not ready or fault is not None:
            _end(process)
            raise ReactError(f"the path planner's process did not start{f': {fault}' if fault else ''}")
        self._process = process
        return process


def _send(pipe: IO[bytes], message: Any) -> None:
    content = pickle.dumps(message)
    pipe.write(struct.pack("<Q", len(content)) + content)
    pipe.flush()


def _receive(pipe: IO[bytes] | None, deadline: float) -> tuple[bool, Any]:
    """Return whether a whole message came before the deadline, and the message."""
    assert pipe is not None
    content, wanted = b"", 8
    while len(content) < wanted:
        ready, _, _ = select.select([pipe], [], [], max(0.0, deadline - time.monotonic()))
        more = os.read(pipe.fileno(), 1 << 20) if ready else b""
        if not more:
            return False, None
        content += more
        if len(content) >= 8:
            wanted = 8 + struct.unpack("<Q", content[:8])[0]
    return True, pickle.loads(content[8:])


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()


def main() -> None:
    """Answer queries from standard input until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # meant for the parent, which ends this process
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    queries = sys.stdin.buffer

    def read() -> Any:
        head = queries.read(8)
        return pickle.loads(queries.read(struct.unpack("<Q", head)[0])) if len(head) == 8 else None

    grids, planner, parameters, iterations, seed = read()
    try:
        from react_opt.paths.ompl_ import ompl, search

        ompl()
    except Exception as error:  # the parent reports it: a child has nobody to raise to
        _send(answers, repr(error))
        return
    _send(answers, None)
    while (query := read()) is not None:
        start, goal = query
        own = np.random.SeedSequence([seed, *np.concatenate(query).view(np.uint64).tolist()])
        _send(answers, search(grids, planner, parameters, iterations, int(own.generate_state(1)[0]), start, goal))


if __name__ == "__main__":
    main()

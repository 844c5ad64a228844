"""Live lines on standard error while something works; silent where that is no terminal."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, TimeElapsedColumn
from rich.text import Text

from react_opt.plan import gap_of
from react_opt.report.tables import percent, shown


@contextlib.contextmanager
def live_line() -> Iterator[Callable[[float, float | None, float | None], None] | None]:
    """Yield a progress callback that shows time, incumbent, bound and gap; None where nobody watches."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    with Live(Text("solving"), console=console, refresh_per_second=8, transient=True) as live:

        def show(elapsed_s: float, incumbent: float | None, bound: float | None) -> None:
            gap = percent(gap_of(incumbent, bound))
            line = f"{elapsed_s:7.1f} s   best {shown(incumbent)}   bound {shown(bound)}   gap {gap}"
            live.update(Text(line))

        yield show


@contextlib.contextmanager
def mission_bar(horizon_s: float) -> Iterator[Callable[[float, float], None] | None]:
    """Yield a progress callback of simulated time (s) and coverage; None where nobody watches."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    columns = ("{task.description}", BarColumn(), "{task.completed:.0f} of at most {task.total:.0f} s")
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("known   0.0 %", total=horizon_s)

        def show(t_s: float, coverage: float) -> None:
            bar.update(task, completed=t_s, description=f"known {coverage:6.1%}")

        yield show


@contextlib.contextmanager
def share_bar(what: str) -> Iterator[Callable[[float], None] | None]:
    """Yield a progress callback of the share that is done, from 0 to 1; None where nobody watches."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    columns = ("{task.description}", BarColumn(), "{task.percentage:3.0f} %", TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)

"""A live line on standard error while a solver works; silent where that is no terminal."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.live import Live
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

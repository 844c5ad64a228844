"""After the warm-up no solve compiles anything: a deadline is for solving."""

import subprocess
import sys
from pathlib import Path

PROGRAM = """
import sys
from numba.core.dispatcher import Dispatcher

def compiled():
    found = {}
    for name, module in list(sys.modules.items()):
        if name.startswith("react_opt"):
            for each in vars(module).values():
                if isinstance(each, Dispatcher):
                    found[each.__module__ + "." + each.__name__] = len(each.signatures)
    return found

from benchmarks.families import FAMILIES
from by_option import OPTIONS, drawn
from react_opt import solve
from react_opt.jsonio import parse
from react_opt.solvers.oros import solve_oros
from react_opt.solvers.warm import warm_up

warm_up("oros", solve_oros)
before = compiled()
assert sum(count > 0 for count in before.values()) > 10, before
instances = [drawn(option, 1) for option in OPTIONS]
instances += [parse(FAMILIES[name].make(seed=0, **FAMILIES[name].sizes["tiny"])) for name in ("tight_grid", "chargers")]
instances.append(parse(FAMILIES["walled_grid"].make(seed=0, rows=5, cols=10, robots=2, horizon=90)))
instances.append(parse(FAMILIES["walled_grid"].make(seed=0, rows=6, cols=10, robots=3, horizon=32)))
for instance in instances:
    solve(instance, method="routes", threads=1, work_limit=30 if len(instance.cells) < 60 else None)
fresh = {name for name, count in compiled().items() if count != before.get(name, 0)}
print(*sorted(fresh))
"""


def test_no_kernel_is_compiled_after_the_warm_up() -> None:
    """Every signature of every kernel is there once the warm-up is over, whatever option an instance uses."""
    root = Path(__file__).resolve().parents[3]
    paths = f"import sys; sys.path[:0] = [{str(root)!r}, {str(root / 'tests' / 'agreement')!r}]\n"
    done = subprocess.run([sys.executable, "-c", paths + PROGRAM], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []

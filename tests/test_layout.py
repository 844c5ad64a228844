"""The order of dependence, read from the source: which part may import which, and who may import which library."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "react_opt"
MODULES = sorted(path.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py"))
MOST_LINES = 400

# From the ground up. A part imports from its own layer and from those above it in this list, never from below.
LAYERS = [
    {"errors", "references", "instance", "plan", "trace", "jsonio", "kernels"},
    {"certify", "certify_base", "certify_replay", "certify_robot", "certify_oros"}
    | {"certify_bound", "certify_bound_best", "certify_bound_charge", "certify_bound_choice", "certify_bound_enumerate"}
    | {
        "certify_bound_kernel",
        "certify_bound_route",
        "certify_assignment",
        "certify_inspection",
        "certify_trace",
        "certify_scans",
    },
    {"geometry", "energy", "timegraph", "route_problem", "paths", "options", "interrupt", "areas", "passages"}
    | {"jobs", "jobs_file", "jobs_worker", "jobs_ray"},
    {"models", "claims"},
    {"solvers", "replan", "build"},
    {"planner"},
    {"orchestrator"},
    {"sim"},
    {"limits"},
    {"report"},
    {"cli_bench", "cli_help"},
    {"cli", "__main__"},
]
CHECKER = LAYERS[1]
CHECKER_MAY = {"react_opt." + name for name in (LAYERS[0] - {"kernels"}) | CHECKER}

SOLVER_LIBRARIES = {"highspy", "ortools", "cvxpy", "pyscipopt", "pyvrp", "gurobipy", "mip", "pulp"}
HEAVY = {"cvxpy", "ortools", "highspy", "ompl", "matplotlib", "numba", "scipy", "pyscipopt", "ray"}


@dataclass(frozen=True)
class Import:
    """An import statement: the module named, where it stands, and whether it runs when the file is imported."""

    module: str
    line: int
    eager: bool


def imports(relative: Path) -> Iterator[Import]:
    """Yield the imports of a file; those for type checkers only are left out."""
    tree = ast.parse((PACKAGE / relative).read_text())
    skipped = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")
        for inner in ast.walk(node)
    }
    lazy = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for inner in ast.walk(node)
    }
    here = ("react_opt", *relative.with_suffix("").parts)
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            for name in node.names:
                yield Import(name.name, node.lineno, id(node) not in lazy)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(here[: -node.level]) if node.level else ""
            module = ".".join(part for part in (base, node.module or "") if part)
            for name in node.names:
                whole = (
                    module == "react_opt" or (PACKAGE.parent / module.replace(".", "/") / f"{name.name}.py").exists()
                )
                yield Import(f"{module}.{name.name}" if whole else module, node.lineno, id(node) not in lazy)


def part(module: str) -> str:
    """Return the part of the package in which a module lies: ``solvers`` of ``react_opt.solvers.highs_``."""
    return module.split(".")[1] if "." in module else ""


def layer(name: str) -> int:
    """Return the layer of a part."""
    found = [index for index, names in enumerate(LAYERS) if name in names]
    assert found, f"react_opt/{name} has no place in the order of dependence: add it to LAYERS"
    return found[0]


def own(found: Import) -> bool:
    return found.module.split(".")[0] == "react_opt"


def test_there_is_something_to_look_at() -> None:
    assert Path("instance.py") in MODULES
    assert any(own(found) for found in imports(Path("certify.py")))


@pytest.mark.parametrize("relative", MODULES, ids=str)
def test_imports_go_downward_only(relative: Path) -> None:
    name = relative.parts[0].removesuffix(".py")
    if name == "__init__":
        return  # the package's own names are loaded lazily from anywhere
    upward = [
        f"line {found.line}: {found.module}"
        for found in imports(relative)
        if own(found) and part(found.module) != name and layer(part(found.module)) > layer(name)
    ]
    assert upward == []


@pytest.mark.parametrize("relative", MODULES, ids=str)
def test_solver_libraries_stay_in_solvers(relative: Path) -> None:
    if relative.parts[0] == "solvers":
        return
    foreign = [f"line {found.line}: {found.module}" for found in imports(relative) if top(found) in SOLVER_LIBRARIES]
    assert foreign == []


def top(found: Import) -> str:
    return found.module.split(".")[0]


@pytest.mark.parametrize("relative", MODULES, ids=str)
def test_ompl_is_imported_in_one_file_and_lazily(relative: Path) -> None:
    found = [found for found in imports(relative) if top(found) == "ompl"]
    assert all(relative == Path("paths/ompl_.py") and not one.eager for one in found), found


@pytest.mark.parametrize("name", sorted(CHECKER))
def test_the_checker_knows_no_solver_no_model_no_time_graph_and_no_energy_law(name: str) -> None:
    path = Path(f"{name}.py")
    for found in imports(path):
        if own(found):
            compiles = name == "certify_bound_kernel" and found.module == "react_opt.kernels"
            assert found.module in CHECKER_MAY or compiles, f"line {found.line}: {found.module}"
        else:
            assert top(found) == "numpy" or top(found) in sys.stdlib_module_names, f"line {found.line}: {found.module}"


@pytest.mark.parametrize("relative", [path for path in MODULES if path.parts[0] == "orchestrator"], ids=str)
def test_a_strategy_never_sees_the_simulated_world(relative: Path) -> None:
    assert not [found for found in imports(relative) if found.module.startswith("react_opt.sim")]


@pytest.mark.parametrize("relative", MODULES, ids=str)
def test_files_stay_small(relative: Path) -> None:
    lines = len((PACKAGE / relative).read_text().splitlines())
    assert lines <= MOST_LINES, "split it by rule or family"


BENCHMARKS = sorted((PACKAGE.parent / "benchmarks").rglob("*.py"))


@pytest.mark.parametrize("path", BENCHMARKS, ids=lambda path: str(path.relative_to(PACKAGE.parent)))
def test_files_of_the_benchmark_stay_small(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= MOST_LINES, "split it by rule or family"


@pytest.mark.parametrize("relative", MODULES, ids=str)
def test_the_benchmark_stands_on_top_of_the_package(relative: Path) -> None:
    """Only the command line and reports may call it, and only when they are asked to."""
    found = [found for found in imports(relative) if top(found) == "benchmarks"]
    assert all(relative.parts[0] in ("cli_bench.py", "report") and not one.eager for one in found), found


@pytest.mark.parametrize("statement", ["import react_opt", "from react_opt import load, check, parse"])
def test_importing_the_package_loads_nothing_heavy(statement: str) -> None:
    """Loading and checking a file needs no solver, no compiler, no planner and no plots."""
    script = f"import sys; {statement}; print(*sorted({HEAVY!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.split() == []


def test_the_package_names_what_it_offers() -> None:
    import react_opt

    for name in react_opt.__all__:
        assert getattr(react_opt, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'sovle'"):
        _ = react_opt.sovle

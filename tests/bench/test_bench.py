"""``react-opt bench`` from end to end: made-up solvers are exposed, a stopped run goes on, reports and exports hold."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from extras import need

from benchmarks import command, report, runner
from benchmarks.compare import compare
from benchmarks.families import FAMILIES
from benchmarks.peers import PEERS, Limits, load_peers
from benchmarks.suites import SUITES, Entry, Suite, of_family
from benchmarks.verdicts import exposures
from react_opt import check, jsonio, solve
from react_opt.errors import InputError, UsageError
from react_opt.jobs_file import read_lines

ROOT = Path(__file__).parents[2]
LIARS, BREAKERS = (str(Path(__file__).with_name(name)) for name in ("liars.py", "breakers.py"))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of honest and made-up solvers on an assignment and on an OROS instance, with its reports."""
    folder = tmp_path_factory.mktemp("bench")
    entries = [
        *of_family("conflicts", "tiny", [1], ("react_opt", "highs")),
        *of_family("walled_grid", "tiny", [1], ("react_opt", "highs")),
    ]
    suite = Suite("trial", "for the tests", 20.0, tuple(entries))
    settings = runner.Settings(peer_files=(LIARS,), workers=2)
    reports = [str(folder / "report.md"), str(folder / "report.html")]
    assert command.bench(suite, settings, str(folder / "results.jsonl"), reports) == command.EXPOSED
    return folder


def test_made_up_solvers_are_exposed_and_honest_ones_are_not(finished: Path) -> None:
    found = report.of_file(finished / "results.jsonl")
    exposed = {item.peer: item for item in exposures(found.solves)}
    assert set(exposed) == {"wrong_plan", "false_bound", "false_proof", "false_certificate"}
    assert exposed["wrong_plan"].fault == "plan"
    assert "beaten by a checked plan" in exposed["false_bound"].text
    assert exposed["false_proof"].fault == "infeasible"
    assert "its certificate proves" in exposed["false_certificate"].text
    by = {(run["peer"], run["kind"]): run for run in found.solves}
    assert by["react_opt", "oros"]["status"] == by["highs", "oros"]["status"] == "optimal"
    assert by["react_opt", "oros"]["objective"] == pytest.approx(by["highs", "oros"]["objective"], rel=1e-9)
    assert by["react_opt", "oros"]["memory_mb"] > 50


def test_a_solver_that_breaks_is_named_with_its_fault_in_one_row_of_the_report(tmp_path: Path) -> None:
    suite = Suite("trial", "", 2.0, tuple(of_family("conflicts", "tiny", [1], ())))
    settings = runner.Settings(peer_files=(BREAKERS,), workers=2)
    jobs = runner.jobs_of(suite, settings)
    runner.run(suite, settings, str(tmp_path / "r.jsonl"), jobs)
    report.write(tmp_path / "r.jsonl", str(tmp_path / "r.md"))
    text = (tmp_path / "r.md").read_text()
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    (crash,) = [row for row in rows if "one line" in row]
    assert crash.split(" | ", 2)[2].rstrip("| ") == "RuntimeError: one line and another \\| with a bar"
    (other,) = [row for row in rows if "expected a plan" in row]
    assert "the solver returned dict: expected a plan of kind assignment_plan" in other
    assert f"react-opt bench trial --workers 2 --peer {Path(BREAKERS).name} -o" in text


def test_where_it_was_run_is_recorded(finished: Path) -> None:
    (header,) = report.of_file(finished / "results.jsonl").headers
    assert header["machine"]["cores"] >= 1
    assert header["versions"]["react_opt"]
    assert header["suite"] == "trial"
    assert header["begun"].endswith("Z")


def test_the_report_names_the_liars_and_the_losses(finished: Path) -> None:
    for name in ("report.md", "report.html"):
        text = (finished / name).read_text()
        for words in ("Wrong answers", "false_bound", "is beaten by a checked plan", "react_opt loses", "Certificates"):
            assert words in text
    page = (finished / "report.html").read_text()
    assert 'src="data:image/png' in page or "needs matplotlib" in page or "Scaling" not in page
    assert "http" not in page.replace("http-equiv", "")  # opens from disk, loads nothing


def test_show_makes_the_report_of_a_results_file(finished: Path, tmp_path: Path) -> None:
    from react_opt.report.show import show

    show([finished / "results.jsonl"], tmp_path / "page.html")
    assert "is beaten by a checked plan" in (tmp_path / "page.html").read_text()
    with pytest.raises(UsageError, match=r"ends in \.md or \.html"):
        show([finished / "results.jsonl"], tmp_path / "page.png")


def test_a_stopped_run_goes_on_and_gives_the_same_report(finished: Path, tmp_path: Path) -> None:
    """Of the finished file all but three runs are lost, and half a line is left of the fourth."""
    lines = (finished / "results.jsonl").read_text().splitlines(keepends=True)
    file = tmp_path / "results.jsonl"
    file.write_text("".join(lines[:4]) + lines[4][:100])
    kept = [line["key"] for line in read_lines(file) if "key" in line]
    suite = Suite("trial", "", 20.0, tuple(of_family("conflicts", "tiny", [1], ("react_opt", "highs"))))
    settings = runner.Settings(peer_files=(LIARS,))
    jobs = runner.jobs_of(suite, settings)
    ran: list[str] = []
    records = runner.run(suite, settings, str(file), jobs, lambda record: ran.append(record.key))
    assert len(records) == len(jobs)
    assert ran
    assert not set(ran) & set(kept)
    assert set(ran) | set(kept) >= {job.key for job in jobs}
    again = {run["key"]: run for run in report.of_file(file).solves}
    for run in report.of_file(finished / "results.jsonl").solves:
        if run["key"] in again:
            mine = again[run["key"]]
            assert (run["status"], run["objective"], run["bound"]) == (mine["status"], mine["objective"], mine["bound"])


def test_results_of_two_machines_are_compared(finished: Path, tmp_path: Path) -> None:
    """The same answers in half the time, but for one value that was changed by hand."""
    lines = [json.loads(line) for line in (finished / "results.jsonl").read_text().splitlines()]
    for line in lines[1:]:
        line["result"]["wall_s"] /= 2
    other = tmp_path / "other.jsonl"
    other.write_text("".join(json.dumps(line) + "\n" for line in lines))
    found = compare(report.of_file(finished / "results.jsonl"), report.of_file(other))
    assert found.both == len(lines) - 1
    assert found.solved >= 4
    assert found.differences == []
    assert found.ratio["react_opt"] == pytest.approx(0.5, rel=0.05)
    assert command.compare(str(finished / "results.jsonl"), str(other)) == command.OK
    changed = next(line for line in lines[1:] if line["result"]["peer"] == "highs")
    for field in ("objective", "bound", "claimed"):
        changed["result"][field] -= 1.0
    other.write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert command.compare(str(finished / "results.jsonl"), str(other)) == command.OK  # exposed, so no longer solved
    for line in lines[1:]:
        if line["result"]["case"] == changed["result"]["case"] and line["result"]["peer"] in ("react_opt", "highs"):
            line["result"].update(objective=5.0, bound=5.0, claimed=5.0, trajectory=[], certified=None)
    other.write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert command.compare(str(finished / "results.jsonl"), str(other)) == command.EXPOSED


def test_a_killed_run_counts_as_unsolved(tmp_path: Path) -> None:
    entry = of_family("walled_grid", "tiny", [1], ("react_opt",))
    suite = Suite("trial", "", 20.0, tuple(entry), memory_mb=20.0)
    jobs = runner.jobs_of(suite, runner.Settings())
    runner.run(suite, runner.Settings(), str(tmp_path / "r.jsonl"), jobs)
    found = report.of_file(tmp_path / "r.jsonl")
    assert [run["status"] for run in found.solves] == ["memory"]
    report.write(found, str(tmp_path / "r.html"))
    assert "killed above 20 MB" in (tmp_path / "r.html").read_text()


def by_highs(file: Path) -> float:
    import highspy

    highs = highspy.Highs()
    highs.setOptionValue("output_flag", False)
    highs.setOptionValue("mip_rel_gap", 1e-9)
    assert highs.readModel(str(file)) == highspy.HighsStatus.kOk
    highs.run()
    return float(highs.getInfo().objective_function_value)


def by_scip(file: Path) -> float:
    need("pyscipopt", "scip")
    import pyscipopt

    model = pyscipopt.Model()
    model.hideOutput()
    model.setParam("limits/gap", 1e-9)
    model.readProblem(str(file))
    model.optimize()
    return float(model.getObjVal())


def by_cbc(file: Path) -> float:
    need("cylp", "peers")
    from cylp.cy import CyClpSimplex

    simplex = CyClpSimplex()
    simplex.logLevel = 0
    assert simplex.readMps(str(file)) == 0
    model = simplex.getCbcModel()
    model.logLevel = 0
    model.solve()
    return float(model.objectiveValue)


@pytest.mark.extras
@pytest.mark.parametrize("solver", [by_highs, by_scip, by_cbc])
@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("chargers", {"rows": 2, "cols": 3, "robots": 1, "horizon": 8}),
        ("generalised", {"robots": 3, "targets": 8, "type": "C"}),
        ("inspection_tight", {"robots": 2, "targets": 5}),
    ],
)
def test_exported_models_solved_outside_agree(
    tmp_path: Path, name: str, parameters: dict[str, Any], solver: Callable[[Path], float]
) -> None:
    """The MPS file, which minimises, solved without this package has the optimum that the JSON file has here."""
    suite = Suite("trial", "", 1.0, (Entry({"family": name, "parameters": parameters, "seed": 4}, ()),))
    assert command.export(suite, str(tmp_path)) == 1
    (file,) = tmp_path.glob("*.json")
    plan = solve(jsonio.load(file), threads=1, explain=False)
    assert plan.claim.status == "optimal"
    assert -solver(file.with_suffix(".mps")) == pytest.approx(plan.claim.objective, rel=1e-6)


def test_text_of_files_cannot_become_script(tmp_path: Path) -> None:
    line = {"key": "solve {}", "ending": "done", "host": "h"}
    bad = "<script>alert(1)</script>"
    result = {
        "what": "solve", "instance": bad, "case": {"family": "conflicts", "parameters": {}, "seed": 1}, "kind": bad,
        "gap_asked": 0.0, "peer": bad, "version": "1", "status": "feasible", "objective": 1.0, "bound": None,
        "violations": [], "tolerance": None, "wall_s": 1.0, "limit_s": 2.0, "trajectory": [],
    }  # fmt: skip
    header = {
        "kind": "bench_results", "suite": bad, "machine": runner.machine(), "versions": {}, "commit": None,
        "workers": 1, "begun": "",
    }  # fmt: skip
    (tmp_path / "r.jsonl").write_text(json.dumps(header) + "\n" + json.dumps({**line, "result": result}) + "\n")
    report.write(tmp_path / "r.jsonl", str(tmp_path / "r.html"))
    assert "<script" not in (tmp_path / "r.html").read_text()


def test_what_cannot_be_run_is_said(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected one of smoke, standard"):
        command.suite_of(["smoek"], None)
    with pytest.raises(UsageError, match="solver: expected one of"):
        runner.jobs_of(SUITES["smoke"], runner.Settings(only=("nobody",)))
    with pytest.raises(UsageError, match=r"ends in \.md or \.html"):
        report.form_of("report.pdf")
    with pytest.raises(InputError, match="expected a Python file that registers a solver"):
        runner.jobs_of(SUITES["smoke"], runner.Settings(peer_files=("/nowhere.py",)))
    (tmp_path / "empty.py").write_text("")
    with pytest.raises(InputError, match="registers no solver"):
        runner.jobs_of(SUITES["smoke"], runner.Settings(peer_files=(str(tmp_path / "empty.py"),)))
    plan = tmp_path / "plan.json"
    plan.write_text('{"kind": "oros_plan"}')
    with pytest.raises(InputError, match="holds something else than results"):
        command.bench(SUITES["smoke"], runner.Settings(), str(plan), [])
    assert plan.read_text() == '{"kind": "oros_plan"}'
    (tmp_path / "r.jsonl").write_text("{}\n")
    with pytest.raises(InputError, match="expected results of react-opt bench"):
        report.of_file(tmp_path / "r.jsonl")


def test_the_command_line_refuses_a_bad_file_in_one_line(tmp_path: Path) -> None:
    bad = tmp_path / "p.txt"
    bad.write_text("n 3\n")
    arguments = ["bench", "--read", "chao", str(bad), "-o", str(tmp_path / "r.jsonl")]
    done = subprocess.run(
        [sys.executable, "-m", "react_opt.cli", *arguments], capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == 2
    assert done.stderr.splitlines() == [f"{bad}: expected the lines n, m and tmax"]
    assert not (tmp_path / "r.jsonl").exists()


def test_the_solver_of_the_documentation_runs(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "add_your_solver.md").read_text()
    file = tmp_path / "my_solver.py"
    file.write_text(text.split("```python\n", 1)[1].split("```", 1)[0])
    assert load_peers([str(file)]) == ("mine",)
    family = FAMILIES["inspection_floor"]
    instance = jsonio.parse(family.make(seed=1, **family.sizes["tiny"]))
    told: list[float | None] = []
    plan = PEERS["mine"].solve(instance, Limits(1.0), lambda at_s, value, bound: told.append(value))
    del PEERS["mine"]
    assert check(instance, plan).ok
    assert told[-1] == plan.claim.objective
    assert plan.claim.objective > 0


def test_suites_have_their_families_and_solvers() -> None:
    for suite in SUITES.values():
        jobs = runner.jobs_of(suite, runner.Settings())
        assert len({job.key for job in jobs}) == len(jobs)
        assert all(job.time_limit_s and job.memory_limit_mb for job in jobs)
    named = {entry.case["family"] for entry in SUITES["standard"].entries}
    assert named == set(FAMILIES)


def test_the_wheel_holds_the_benchmarks_and_the_map_of_the_factory() -> None:
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert "benchmarks" in build["packages"]
    for source, target in build["force-include"].items():
        assert (ROOT / source).is_file()
        assert target.startswith("benchmarks/data/factory/")

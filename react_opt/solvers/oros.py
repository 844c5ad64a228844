"""The OROS recipe: a greedy plan first, then the method that fits, then the replay by the checker."""

from __future__ import annotations

import time
from typing import Any

from react_opt.certify import check
from react_opt.claims import optimality_tolerance, relaxation_bound
from react_opt.errors import InputError, UsageError
from react_opt.instance import OrosInstance
from react_opt.models.oros import column_count
from react_opt.models.readback import explored_value, routes_of
from react_opt.options import SolveOptions
from react_opt.plan import Claim, OrosPlan, Plan
from react_opt.replan import freeze
from react_opt.route_problem import RouteProblem
from react_opt.solvers.monolith import solve_monolith
from react_opt.solvers.oros_answer import answer, without_plan
from react_opt.solvers.oros_search import Search, proven
from react_opt.solvers.outcome import Request
from react_opt.solvers.routes.engine import solve_routes
from react_opt.solvers.routes.greedy import InfeasibleRobot, greedy
from react_opt.solvers.routes.search import improve
from react_opt.timegraph import route_problem

MAX_ENTRIES = 150_000_000  # cells x steps of the reward profile: about 5 GB while it is built
MAX_PLAN_STEPS = 5_000_000  # rows of a plan file
MAX_COLUMNS = 4_000_000  # of the monolith
BUILD_S = 1e-5  # per column of the monolith, to build it and hand it to a solver: neither can be interrupted
GREEDY_S = 2.0  # granted to the greedy plan where the deadline is nearer
COUPLED_SHARE = 0.3  # of the time, for the decomposition where there are limits between robots
COUPLED_S, SMALL_COLUMNS = 1.0, 50_000  # at most so long where the monolith is small
FEW_COLUMNS = 3000  # of a monolith that proves what chargers leave open
IMPROVE_S, IMPROVE_SHARE, IMPROVE_WORK = 1.0, 0.05, 20  # primal search before the monolith


def solve_oros(
    instance: OrosInstance, options: SolveOptions, start: Plan | None = None, at_step: int | None = None
) -> OrosPlan:
    """Solve an ``oros`` instance; see :func:`react_opt.solve`."""
    entries = len(instance.cells) * (instance.horizon_steps + 1)
    rows = sum(instance.horizon_steps + 1 - robot.start_step for robot in instance.robots)
    if entries > MAX_ENTRIES or rows > MAX_PLAN_STEPS:
        reason = f"memory: {entries} cells x steps (at most {MAX_ENTRIES}), {rows} plan rows (at most {MAX_PLAN_STEPS})"
        return without_plan(instance, options, Claim(status="no_plan", limit="memory", reason=reason))
    require_start(instance, start, at_step)
    search = _begin(instance, options, start, at_step)
    search.wall_s["build"] = time.perf_counter() - options.begun
    _timed(search, "greedy", _greedy)
    if search.infeasible is None and not proven(search):
        _timed(search, "solve", _choose(search))
    return answer(search)


def require_start(instance: OrosInstance, start: Plan | None, at_step: int | None) -> None:
    """Refuse a plan to start from that is none of this instance, and a step outside its horizon.

    Raises
    ------
    InputError
        Where the plan has another kind, breaks a rule or holds no robots.
    UsageError
        Where the step lies outside the horizon.
    """
    if start is None:
        return
    if not isinstance(start, OrosPlan):
        raise InputError.single("<start>", "kind", f"expected an oros_plan, found {start.kind!r}")
    found = check(instance, start)
    if not found.ok:
        raise InputError.single("<start>", "", f"expected a valid plan of this instance: {found.violations[0]}")
    if not start.robots and instance.robots:
        raise InputError.single("<start>", "robots", "expected a plan to start from, found none")
    if at_step is not None and not 0 <= at_step <= instance.horizon_steps:
        raise UsageError(f"at step: expected 0 to {instance.horizon_steps}, found {at_step}")


def _begin(instance: OrosInstance, options: SolveOptions, start: Plan | None, at_step: int | None) -> Search:
    problem = route_problem(instance)
    search = Search(instance, options, problem, explored_value(instance), relaxation_bound(problem))
    if start is None:
        return search
    assert isinstance(start, OrosPlan)
    routes = routes_of(instance, problem, start)
    search.offer(routes)
    if at_step is not None:
        search.at_step = at_step
        search.frozen = freeze(problem, routes, at_step)
        search.bound = search.frozen.earned + relaxation_bound(search.frozen.problem)
    return search


def _timed(search: Search, phase: str, work: Any) -> None:
    begun = time.perf_counter()
    work(search)
    search.wall_s[phase] = search.wall_s.get(phase, 0.0) + time.perf_counter() - begun


def _greedy(search: Search) -> None:
    """Put a plan in hand before any solver starts."""
    if search.candidates:
        return
    latest = search.options.deadline
    until = None if latest is None else max(latest, time.perf_counter() + GREEDY_S)
    found = greedy(search.problem, until, seed=search.options.seed)
    if isinstance(found.reason, InfeasibleRobot):
        robot = search.instance.robots[found.reason.robot].id
        search.infeasible = f"robot {robot}: {found.reason.rule}: {found.reason.text}"
        search.method = "relaxation to one robot"
    elif found.routes is not None:
        search.offer(found.routes)
    else:
        search.settings["greedy"] = found.reason
    search.progress(0.0, None, None)


def _choose(search: Search) -> Any:
    """Return the method that fits, and note why where the choice was forced."""
    options = search.options
    if options.method == "routes":
        if options.solver not in (None, "highs"):
            raise UsageError(f"solver: the method routes works with highs, not with {options.solver!r}")
        search.method = "routes: asked for"
        return _routes
    if options.method == "monolith":
        search.method = "monolith: asked for"
    elif options.solver is not None:
        search.method = f"monolith: the solver {options.solver} was asked for"
    else:
        search.method = "routes"
        return _routes_then_monolith
    return _monolith


def _coupled(problem: RouteProblem) -> bool:
    """Whether there are limits between robots, which the decomposition carries as rows but may not branch on."""
    limits = (problem.robots_per_cell, problem.sensing_robots_per_step)
    return problem.forbid_swaps or any(limit is not None for limit in limits)


def _routes_then_monolith(search: Search) -> None:
    """Where the decomposition ends without a proof, which limits between robots may cause, the monolith goes on.

    So it does after chargers, where it is small; a large one proves less than the decomposition does.
    """
    coupled = _coupled(search.problem)
    charging = bool((search.problem.charger_j > 0).any()) and column_count(search.problem) <= FEW_COLUMNS
    _routes(search, _until(search) if coupled or charging else None)
    ended = coupled or charging or search.limit == "none"
    if proven(search) or not ended or search.infeasible is not None or search.options.stopped():
        return
    cause = "it ended without a proof"
    if coupled or charging:
        cause = f"{'limits between robots' if coupled else 'chargers'} kept it from a proof"
    search.method = f"routes, then monolith: {cause}"
    search.settings["routes"] = {"solver": search.solver, "limit": search.limit}
    _monolith(search)
    if "monolith" in search.settings:
        search.method = f"routes: {cause}, and the monolith was {search.settings['monolith']}"


def _until(search: Search) -> float | None:
    """Return when the decomposition leaves the rest of the time to the monolith."""
    options, left_s = search.options, search.options.left_s()
    columns = column_count(search.problem)
    if left_s is not None and BUILD_S * columns > (1.0 - COUPLED_SHARE) * left_s:
        return None  # the monolith could not even be built
    small = columns <= SMALL_COLUMNS
    shares = [COUPLED_S if small else None, None if left_s is None else COUPLED_SHARE * left_s]
    known = [share for share in shares if share is not None]
    return time.perf_counter() + min(known) if known and options.work_limit is None else None


def _routes(search: Search, until: float | None = None) -> None:
    """Solve by the decomposition; with fixed first steps, the rest is a problem of its own."""
    options, known, frozen = search.options, search.best, search.frozen
    problem = search.problem if frozen is None else frozen.problem
    earned = 0.0 if frozen is None else frozen.earned
    start = None if known is None else known[1] if frozen is None else frozen.rest(known[1])
    shift = earned + search.constant

    def progress(elapsed_s: float, incumbent: float | None, bound: float | None) -> None:
        search.progress(
            elapsed_s, None if incumbent is None else incumbent + shift, None if bound is None else bound + shift
        )

    latest = None if options.deadline is None else options.deadline - _check_reserve_s(search)
    result = solve_routes(
        problem,
        deadline=min((t for t in (until, latest) if t is not None), default=None),
        work_limit=options.work_limit,
        gap=options.gap,
        threads=options.threads,
        seed=options.seed,
        start=start,
        on_progress=progress,
        should_stop=options.should_stop,
    )
    search.solver, search.limit = "highs", result.limit
    search.packages = (*search.packages, "highspy")
    search.settings["work"] = result.iterations
    if result.notes:
        search.settings["notes"] = list(result.notes)
    if result.routes is not None:
        search.offer(result.routes if frozen is None else frozen.whole(result.routes))
    if result.bound is not None:
        if result.bound + earned < search.bound and frozen is None:
            search.certificate = result.certificate or None
        search.bound = min(search.bound, result.bound + earned)
    if result.status == "infeasible" and known is None:
        search.infeasible = f"fleet: {'; '.join(result.notes)}"


def _monolith(search: Search) -> None:
    options, known = search.options, search.best
    columns = column_count(search.problem)
    if columns > MAX_COLUMNS:
        search.settings["monolith"] = f"not built: about {columns} columns, at most {MAX_COLUMNS}"
        search.limit = "memory"
        return
    left_s = options.left_s()
    if left_s == 0.0:
        search.limit = "time"
        return
    if left_s is not None and BUILD_S * columns > left_s:
        search.settings["monolith"] = f"not built: about {columns} columns, too many for {left_s:.2g} s"
        _improve(search, 0.9 * left_s)
        search.limit = "time"
        return
    _improve(search, IMPROVE_S if left_s is None else min(IMPROVE_S, IMPROVE_SHARE * left_s))
    known, constant = search.best, search.constant
    objective = None if known is None else known[0] + constant
    request = Request(
        time_limit_s=options.left_s(reserve_s=_check_reserve_s(search)),
        work_limit=options.work_limit,
        gap_rel=options.gap or 0.0,
        gap_abs=0.5 * optimality_tolerance(objective or 0.0, search.problem.sigma),
        threads=options.threads,
        seed=options.seed,
        on_progress=search.progress,
        should_stop=options.should_stop,
    )
    solver = options.solver or "highs"
    outcome, routes = solve_monolith(
        search.instance, search.problem, solver, request, None if known is None else known[1], search.at_step
    )
    search.solver, search.limit = outcome.solver, outcome.limit
    search.settings.update(outcome.settings)
    search.settings["solver_version"] = outcome.version
    if routes is not None:
        search.offer(routes)
    if outcome.bound is not None:
        search.bound = min(search.bound, outcome.bound - constant)
    if outcome.status == "infeasible" and known is None:
        search.infeasible = f"fleet: the {solver} solver proved that no plan keeps all limits together"


def _improve(search: Search, longest_s: float) -> None:
    """Give the monolith a better plan to start from, in a part of the time or work there is."""
    known, options = search.best, search.options
    if known is None or search.frozen is not None:
        return
    steady = options.work_limit is not None
    better = improve(
        search.problem,
        known[1],
        deadline=None if steady else time.perf_counter() + longest_s,
        work_limit=IMPROVE_WORK if steady else None,
        seed=options.seed,
        should_stop=options.should_stop,
    )
    search.offer(better)
    search.progress(0.0, None, None)


def _check_reserve_s(search: Search) -> float:
    """Seconds to keep for reading the plan back and replaying it, about 3 microseconds per row and a margin."""
    rows = sum(search.problem.horizon + 1 - group.start_step for group in search.problem.classes for _ in group.robots)
    return 0.01 + 2e-5 * rows

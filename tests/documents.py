"""One good document of each kind of file, as plain data, and a way to change a place in it."""

from __future__ import annotations

import copy
import re
from typing import Any

from good_plan import instance_data, plan_data

from react_opt.jsonio import parse, sha256

Data = dict[str, Any]
DELETE = object()

PROFILE: Data = {
    "length_m": 0.508,
    "width_m": 0.43,
    "speed_max_m_s": 0.9,
    "speed_min_m_s": 0.3,
    "full_speed_clearance_m": 0.5,
    "accel_m_s2": 1.0,
    "turn_rad_s": 1.5,
    "idle_w": 2.0,
    "motion_w": 7.0,
    "turn_w": 3.0,
    "sensing_w": 16.9,
    "battery_j": 8000.0,
    "capacity_j": 9000.0,
    "reserve_j": 100.0,
    "lidar_range_m": 8.0,
    "lidar_rays": 360,
}
ROBOTS = [{"id": "r1", "profile": "jackal", "x_m": 1.0, "y_m": 2.0, "yaw_rad": 0.0}]

ASSIGNMENT: Data = {
    "kind": "assignment",
    "schema_version": 1,
    "name": "targets",
    "robots": [
        {"id": "r1", "battery_j": 100.0, "reserve_j": 10.0, "capacity": 1, "zone": ["t1", "t2"]},
        {"id": "r2", "battery_j": 50.0},
    ],
    "targets": [{"id": "t1", "gain": 3.0}, {"id": "t2", "gain": 2.0}],
    "costs": [
        {"robot": "r1", "target": "t1", "time_s": 2.0, "energy_j": 5.0},
        {"robot": "r2", "target": "t2", "time_s": 1.0, "energy_j": 5.0},
    ],
    "conflicts": [["t1", "t2"]],
    "weights": {"alpha": 1.0, "beta": 1.0, "time_ref_s": 10.0},
}
INSPECTION: Data = {
    "kind": "inspection",
    "schema_version": 1,
    "name": "tour",
    "time_left_s": 60.0,
    "robots": [{"id": "r1", "at": "dock", "battery_j": 100.0, "reserve_j": 10.0, "end": "dock"}],
    "targets": [{"id": "t1", "value": 2.0, "service_s": 1.0, "service_energy_j": 2.0}],
    "travel": [
        {"from": "dock", "to": "t1", "time_s": 5.0, "energy_j": 10.0},
        {"from": "t1", "to": "dock", "time_s": 5.0, "energy_j": 10.0},
        {"from": "t1", "to": "dock", "time_s": 6.0, "energy_j": 9.0, "robot": "r1"},
    ],
    "minimise": "time",
}
FLEET: Data = {
    "kind": "fleet",
    "schema_version": 1,
    "name": "jackals",
    "profiles": {"jackal": PROFILE},
    "robots": ROBOTS,
    "chargers": [{"x_m": 0.0, "y_m": 0.0, "power_w": 50.0, "slots": 1}],
}
MISSION: Data = {
    "kind": "mission",
    "schema_version": 1,
    "name": "fire",
    "map": "building.yaml",
    "cell_m": 10.0,
    "horizon_s": 240.0,
    "step_s": 10.0,
    "profiles": {"jackal": PROFILE},
    "robots": ROBOTS,
    "delta": 0.9,
    "window_steps": 24,
    "strategy": "react",
    "postpone_below": 0.5,
    "link": {"x_m": 0.0, "y_m": 0.0, "range_m": 30.0, "rate_bit_s": 1e6, "outages_s": [[5.0, 9.0]]},
    "seed": 1,
}
CLAIM: Data = {"status": "feasible", "objective": 1.0}
ASSIGNMENT_PLAN: Data = {
    "kind": "assignment_plan",
    "instance": {"name": "targets", "sha256": "0" * 64},
    "claim": CLAIM,
    "assigned": [{"robot": "r1", "target": "t1"}],
    "deferred": [{"target": "t2", "reason": "conflict", "loss": 0.5}],
}
INSPECTION_PLAN: Data = {
    "kind": "inspection_plan",
    "instance": {"name": "tour", "sha256": "0" * 64},
    "claim": CLAIM | {"secondary": {"objective": 12.0, "bound": 12.0, "status": "optimal"}},
    "routes": [
        {
            "robot": "r1",
            "stops": [{"target": "t1", "arrive_s": 5.0, "leave_s": 6.0, "battery_j": 88.0}],
            "end": "dock",
            "finish_s": 12.0,
            "finish_battery_j": 79.0,
        }
    ],
    "t_dpi_s": 12.0,
}


def document(kind: str) -> Data:
    """Return a fresh copy of the good document of a kind."""
    if kind == "oros":
        return instance_data()
    if kind == "oros_plan":
        return plan_data() | {"instance": {"name": "row", "sha256": sha256(parse(instance_data()))}}
    others = (ASSIGNMENT, INSPECTION, FLEET, MISSION, ASSIGNMENT_PLAN, INSPECTION_PLAN)
    return copy.deepcopy(next(data for data in others if data["kind"] == kind))


KINDS = ["oros", "assignment", "inspection", "fleet", "mission", "oros_plan", "assignment_plan", "inspection_plan"]


def put(data: Data, place: str, value: Any) -> Data:
    """Set the value at a place such as ``robots[1].start`` (an index one past the end appends); return the data."""
    keys: list[Any] = [int(part[1:-1]) if part[0] == "[" else part for part in re.findall(r"\[\d+\]|[^.\[]+", place)]
    inner: Any = data
    for key in keys[:-1]:
        inner = inner.setdefault(key, {}) if isinstance(inner, dict) else inner[key]
    last = keys[-1]
    if value is DELETE:
        del inner[last]
    elif isinstance(inner, list) and last == len(inner):
        inner.append(value)
    else:
        inner[last] = value
    return data

"""Make every file of this folder: the map, the fleets, and the instances built from them.

Run ``python examples/factory/make_examples.py [FOLDER]``. Each instance is what this command writes:

    react-opt build factory.yaml --fleet fleet_N.json --cell-m C --horizon-s 240 --step-s S -o factory_N_Cm.json

The missions (``mission_N.json``) are simulated: ``react-opt simulate mission_3.json``.

The fleets are 1 to 4 Clearpath Jackals that wait in the entry tunnel, the first one nearest to its mouth. What is
known of the robot is its size, 508 mm x 430 mm, and its battery (270 Wh = 972 000 J). The powers are chosen to
agree with the published totals (arXiv 2503.05904): 16.9 W for sensing, processing and communication, 7 W for
motion at the cruise speed of 0.89 m/s and 2 W always; with them the paper's battery of 8245.96 J lasts for some
300 s. Turning takes 9 W, as skid steering costs more than driving straight. Speed falls from 0.89 m/s at 0.6 m from
obstacles to 0.3 m/s at contact. The file ``fleet_4_real_battery.json`` has the battery of the data sheet, and
``fleet_3_low_battery.json`` three robots that start with 1200 J, of which 150 J are a reserve, and a charger of
60 W half way: there the battery decides who may go how far.

Every drive is rounded up to whole steps, so a step should be about the time to cross a cell, or a fraction of it.
Cells of 10 m have the paper's steps of 10 s, 24 in all: a crossing takes 11 to 21 s and rounding adds 45 % to the
drives. For cells of 5 m (5.5 to 12 s) steps of 6 s add 30 %, for cells of 2.5 m (2.1 to 7 s) steps of 3 s add 22 %:
most crossings are one step. Half those steps would add half as much and double the size of the problem.
"""

from __future__ import annotations

import sys
from pathlib import Path

from draw_factory import main as draw

from react_opt.build import build
from react_opt.geometry import load_map
from react_opt.instance import Fleet, FleetCharger, FleetRobot, Mission, Noise, Profile
from react_opt.jsonio import save

HORIZON_S = 240.0
STEP_S = {10.0: 10.0, 5.0: 6.0, 2.5: 3.0}
TUNNEL_X_M, TUNNEL_Y_M = 13.3, (5.4, 4.2, 3.0, 1.8)
PAPER_BATTERY_J, REAL_BATTERY_J = 8245.96, 972_000.0


def jackal(battery_j: float, capacity_j: float, reserve_j: float = 0.0) -> Profile:
    """Return the profile of a Jackal with a battery."""
    return Profile(
        length_m=0.508,
        width_m=0.43,
        speed_max_m_s=0.89,
        speed_min_m_s=0.3,
        full_speed_clearance_m=0.6,
        accel_m_s2=1.0,
        turn_rad_s=1.5,
        idle_w=2.0,
        motion_w=7.0,
        turn_w=9.0,
        sensing_w=16.9,
        battery_j=battery_j,
        capacity_j=capacity_j,
        reserve_j=reserve_j,
        lidar_range_m=8.0,
        lidar_rays=360,
    )


def fleet(robots: int, name: str, profile: Profile, chargers: tuple[FleetCharger, ...] = ()) -> Fleet:
    """Return a fleet of Jackals in the tunnel, facing its mouth."""
    return Fleet(
        name=name,
        profiles={"jackal": profile},
        robots=tuple(
            FleetRobot(id=f"r{k + 1}", profile="jackal", x_m=TUNNEL_X_M, y_m=TUNNEL_Y_M[k], yaw_rad=1.5708)
            for k in range(robots)
        ),
        chargers=chargers,
    )


def mission(robots: int, profile: Profile) -> Mission:
    """Return the mission of the paper's evaluation: 240 s on a map that nobody knows, starting in the tunnel."""
    start = fleet(robots, "", profile)
    return Mission(
        name=f"factory, {robots} robot{'s' * (robots > 1)}",
        map="factory.yaml",
        cell_m=10.0,
        horizon_s=HORIZON_S,
        step_s=STEP_S[10.0],
        profiles=start.profiles,
        robots=start.robots,
        delta=0.95,
        strategy="react",
        postpone_below=0.6,
        noise=Noise(speed=0.05, waiting_s=0.3, power=0.02),
        seed=1,
    )


def main(folder: Path) -> None:
    """Write everything into a folder."""
    draw(folder)
    real = jackal(REAL_BATTERY_J, REAL_BATTERY_J)
    save(fleet(4, "4 Jackals, battery of the data sheet", real), folder / "fleet_4_real_battery.json")
    low = jackal(1200.0, PAPER_BATTERY_J, reserve_j=150.0)
    tight = fleet(3, "3 Jackals, low battery", low, (FleetCharger(x_m=8.0, y_m=26.0, power_w=60.0),))
    save(tight, folder / "fleet_3_low_battery.json")
    write_instance(folder, tight, "factory_3_10m_low_battery", 10.0)
    for robots in range(1, 5):
        save(mission(robots, jackal(PAPER_BATTERY_J, PAPER_BATTERY_J)), folder / f"mission_{robots}.json")
        own = fleet(robots, f"{robots} Jackal{'s' * (robots > 1)}", jackal(PAPER_BATTERY_J, PAPER_BATTERY_J))
        save(own, folder / f"fleet_{robots}.json")
        for cell_m in STEP_S:
            write_instance(folder, own, f"factory_{robots}_{cell_m:g}m", cell_m)


def write_instance(folder: Path, own: Fleet, name: str, cell_m: float) -> None:
    """Build one instance on the folder's map."""
    source = load_map(folder / "factory.yaml")
    report = build(source, own, cell_m=cell_m, horizon_s=HORIZON_S, step_s=STEP_S[cell_m], name=name)
    save(report.instance, folder / f"{name}.json")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)

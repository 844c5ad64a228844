"""What goes in: the five kinds of instance files, as frozen pydantic models.

Field names and meanings are the file format. SI units throughout, energy in joules. Rules that span several
fields (names that refer to something, unique ids, order of batteries) are in :mod:`react_opt.references`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from react_opt.references import ReferenceFaultsError, reference_faults

MAX_HORIZON_STEPS = 100_000
MAX_COUNT = 2**63 - 1  # whole numbers fit an int64 array, whatever reads the file
MAX_NUMBER = 1e30  # beyond anything physical; sums and products over a whole instance stay finite
MIN_DIVISOR = 1e-30  # the same for what other numbers are divided by

Id = Annotated[str, StringConstraints(strict=True, min_length=1)]
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-MAX_NUMBER, le=MAX_NUMBER)]
NonNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=MAX_NUMBER)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=MAX_NUMBER)]
Divisor = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=MIN_DIVISOR, le=MAX_NUMBER)]
Share = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1)]
Count = Annotated[int, Field(strict=True, ge=0, le=MAX_COUNT)]
Flag = Annotated[bool, Field(strict=True)]


class Part(BaseModel):
    """Base of everything in a file: frozen, and an unknown field is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class Document(Part):
    """Base of a whole file: its kind, version and name, and the rules that span fields."""

    kind: str
    schema_version: Literal[1] = 1
    name: Annotated[str, Field(strict=True)]

    @model_validator(mode="after")
    def _names_refer(self) -> Self:
        faults = reference_faults(self.model_dump(mode="python", by_alias=True))
        if faults:
            raise ReferenceFaultsError(faults)
        return self


# --- oros ---


class Cell(Part):
    """One area ``g[a,b]`` of the high-level grid."""

    id: Id
    x_m: Finite
    y_m: Finite
    weight: NonNegative = 1.0
    deadline_step: Count | None = None
    explored: Flag = False


class TravelArc(Part):
    """A directed move between two cells, lasting whole steps; parallel arcs are speed modes.

    ``energy_j`` is all the energy of the move but sensing, J.
    """

    from_: Id = Field(alias="from")
    to: Id
    steps: Annotated[int, Field(strict=True, ge=1, le=MAX_COUNT)]
    energy_j: NonNegative
    speed_m_s: NonNegative | None = None


class OrosRobot(Part):
    """A robot of the high-level plan; powers in W, energies in J."""

    id: Id
    start: Id
    start_step: Count = 0
    battery_j: NonNegative
    capacity_j: NonNegative
    reserve_j: NonNegative = 0.0
    idle_w: NonNegative
    sensing_w: NonNegative
    return_to: Id | None = None


class Charger(Part):
    """A charger in a cell: power in W and how many robots may charge at once."""

    cell: Id
    power_w: NonNegative
    slots: Count = 1


class Limits(Part):
    """Coupling limits of the fleet; None means unlimited."""

    robots_per_cell: Count | None = None
    forbid_swaps: Flag = False
    sensing_robots_per_step: Count | None = None


class OrosObjective(Part):
    """Weight of one joule left at the horizon; None takes the default of the design."""

    sigma: NonNegative | None = None


class OrosInstance(Document):
    """High-level exploration: which area each robot goes to next (time-expanded MILP of OROS)."""

    kind: Literal["oros"] = "oros"
    horizon_steps: Annotated[int, Field(strict=True, ge=1, le=MAX_HORIZON_STEPS)]
    step_s: Positive
    cells: tuple[Cell, ...]
    travel: tuple[TravelArc, ...]
    robots: tuple[OrosRobot, ...]
    chargers: tuple[Charger, ...] = ()
    limits: Limits = Limits()
    objective: OrosObjective = OrosObjective()

    @property
    def sigma(self) -> float:
        """Weight of the terminal battery: given, or w0 / (1 + sum of capacities).

        w0 is the smallest positive weight of a cell (1 where no cell has a positive weight).
        """
        if self.objective.sigma is not None:
            return self.objective.sigma
        smallest = min((cell.weight for cell in self.cells if cell.weight > 0), default=1.0)
        return smallest / (1.0 + sum(robot.capacity_j for robot in self.robots))


# --- assignment ---


class AssignmentRobot(Part):
    """A robot that takes local targets; ``zone`` lists the targets it may take, None means all."""

    id: Id
    battery_j: NonNegative
    reserve_j: NonNegative = 0.0
    capacity: Count = 1
    zone: tuple[Id, ...] | None = None


class AssignmentTarget(Part):
    """A local target and what serving it gains."""

    id: Id
    gain: NonNegative


class AssignmentCost(Part):
    """Time and energy for a robot to serve a target; an absent pair is unreachable."""

    robot: Id
    target: Id
    time_s: NonNegative
    energy_j: NonNegative


class AssignmentWeights(Part):
    """Weights of time and energy against gain."""

    alpha: NonNegative = 1.0
    beta: NonNegative = 1.0
    time_ref_s: Divisor = 1.0


class AssignmentInstance(Document):
    """Real-time assignment of local targets to robots."""

    kind: Literal["assignment"] = "assignment"
    robots: tuple[AssignmentRobot, ...]
    targets: tuple[AssignmentTarget, ...]
    costs: tuple[AssignmentCost, ...]
    conflicts: tuple[tuple[Id, Id], ...] = ()
    weights: AssignmentWeights = AssignmentWeights()


# --- inspection ---


class InspectionRobot(Part):
    """A robot of the deferred inspection: where it is, where it must end (None: anywhere)."""

    id: Id
    at: Id
    battery_j: NonNegative
    reserve_j: NonNegative = 0.0
    end: Id | None = None


class InspectionTarget(Part):
    """A postponed target: its value, and what serving it takes."""

    id: Id
    value: NonNegative = 1.0
    service_s: NonNegative = 0.0
    service_energy_j: NonNegative = 0.0


class InspectionTravel(Part):
    """A drive from place to place; a row with ``robot`` overrides the general row for that robot."""

    from_: Id = Field(alias="from")
    to: Id
    time_s: NonNegative
    energy_j: NonNegative
    robot: Id | None = None


class InspectionInstance(Document):
    """Deferred-priority inspection: team orienteering with a time and an energy budget."""

    kind: Literal["inspection"] = "inspection"
    time_left_s: NonNegative
    robots: tuple[InspectionRobot, ...]
    targets: tuple[InspectionTarget, ...]
    travel: tuple[InspectionTravel, ...]
    minimise: Literal["time", "energy"] = "time"


# --- fleet and mission ---


class Profile(Part):
    """A robot type: size, motion, powers, battery and LiDAR.

    Speed is ``speed_max_m_s`` where the clearance is at least ``full_speed_clearance_m`` and falls to
    ``speed_min_m_s`` at contact. ``idle_w`` is always drawn, ``motion_w`` on top while driving, ``turn_w`` on
    top while turning, ``sensing_w`` on top while perception, processing and communication are on.
    """

    length_m: Positive
    width_m: Positive
    speed_max_m_s: Positive
    speed_min_m_s: Positive
    full_speed_clearance_m: NonNegative
    accel_m_s2: Positive
    turn_rad_s: Positive
    idle_w: NonNegative
    motion_w: NonNegative
    turn_w: NonNegative
    sensing_w: NonNegative
    battery_j: NonNegative
    capacity_j: NonNegative
    reserve_j: NonNegative = 0.0
    lidar_range_m: Positive
    lidar_rays: Annotated[int, Field(strict=True, ge=1, le=100_000)]


class FleetRobot(Part):
    """A robot and its start pose in the map's frame."""

    id: Id
    profile: Id
    x_m: Finite
    y_m: Finite
    yaw_rad: Finite = 0.0


class FleetCharger(Part):
    """A charger at a point of the map."""

    x_m: Finite
    y_m: Finite
    power_w: NonNegative
    slots: Count = 1


class Fleet(Document):
    """A fleet: profiles, robots and chargers."""

    kind: Literal["fleet"] = "fleet"
    profiles: dict[Id, Profile]
    robots: tuple[FleetRobot, ...]
    chargers: tuple[FleetCharger, ...] = ()


class Noise(Part):
    """Sources of noise: relative standard deviations of speed and power, mean extra waiting in s."""

    speed: NonNegative = 0.0
    waiting_s: NonNegative = 0.0
    power: NonNegative = 0.0


class Link(Part):
    """The radio channel: a base station, its rate near by, and outages (start and end, s)."""

    x_m: Finite
    y_m: Finite
    range_m: Positive
    rate_bit_s: Positive
    outages_s: tuple[tuple[NonNegative, NonNegative], ...] = ()


class Failure(Part):
    """A robot that dies at a time, s."""

    robot: Id
    t_s: NonNegative


class Mission(Document):
    """A closed-loop mission on a map that only the simulator knows.

    ``extent_m`` is what is known of the building's size: two opposite corners x0, y0, x1, y1 of a rectangle; by
    default that of the areas which cover the map's floor. Where the building turns out larger, areas are added.
    ``switching`` is the rule by which sensors go off: where no pixel would become known (``no_new_pixel``), where
    less than 0.1 m^2 would per scan (``small_gain``), or in areas that are explored (``area_explored``, the
    paper's). With ``blocking`` off robots pass through each other. A robot without progress for ``stuck_s``
    abandons its target.
    """

    kind: Literal["mission"] = "mission"
    map: Annotated[str, Field(strict=True, min_length=1)]
    prior_map: Annotated[str, Field(strict=True, min_length=1)] | None = None
    extent_m: tuple[Finite, Finite, Finite, Finite] | None = None
    cell_m: Positive
    horizon_s: Positive
    step_s: Positive
    profiles: dict[Id, Profile]
    robots: tuple[FleetRobot, ...]
    chargers: tuple[FleetCharger, ...] = ()
    delta: Share
    window_steps: Annotated[int, Field(strict=True, ge=1, le=MAX_HORIZON_STEPS)] | None = None
    strategy: Id
    always_on: Flag = False
    postpone_below: NonNegative
    noise: Noise = Noise()
    link: Link | None = None
    switching: Literal["no_new_pixel", "small_gain", "area_explored"] = "area_explored"
    blocking: Flag = True
    stuck_s: Positive = 20.0
    failures: tuple[Failure, ...] = ()
    seed: Count


Instance = OrosInstance | AssignmentInstance | InspectionInstance
INSTANCE_KINDS: dict[str, type[Document]] = {
    "oros": OrosInstance,
    "assignment": AssignmentInstance,
    "inspection": InspectionInstance,
    "fleet": Fleet,
    "mission": Mission,
}


def canonical(document: Document) -> dict[str, Any]:
    """Return a document as plain data with every default filled in, keys as in the file."""
    return document.model_dump(mode="json", by_alias=True)

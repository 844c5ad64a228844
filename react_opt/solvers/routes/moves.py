"""State of the annealing over sequences, how a sequence is read, and moves of whole segments.

A segment move is judged in constant time before it is made: every part of a sequence that it touches comes later
or earlier by a constant (or is driven backwards), so the change is linear in sums over positions of what a step of
delay costs there, as in local search for minimum latency problems (Silva et al., 2012). Only what looks acceptable
is made and read in full, so any reward profile is valued exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.ranking import inner
from react_opt.solvers.routes.sequences import Steps

Order = NDArray[np.int32]
RandomState = NDArray[np.uint64]


class Tables(NamedTuple):
    """What does not change: see `RouteProblem` and `SequenceModel`; ``back_steps`` is ``steps`` transposed."""

    horizon: int
    sigma: float
    reward: FloatArray
    steps: Steps
    back_steps: Steps
    energy_j: FloatArray
    near: Order
    whole: IntArray
    joules: FloatArray


class State(NamedTuple):
    """Sequences of all robots and what reading them found.

    ``order`` (n_robots, n_cells) and ``lengths`` are the sequences, ``arrival`` their instants, ``values`` what each
    is worth; ``owner`` and ``position`` say where each cell is (owner -1: nowhere, -2: in hand). ``slope`` and
    ``moment`` (n_robots, n_cells + 1) are sums over the positions before k of what one step of delay costs, and of
    that times the arrival. ``slack_j`` is the battery a robot does not need, ``joule`` what its last cell earns per
    joule: the worth of a joule where the battery binds.
    """

    order: Order
    lengths: IntArray
    arrival: Order
    values: FloatArray
    owner: Order
    position: Order
    slope: FloatArray
    moment: FloatArray
    slack_j: FloatArray
    joule: FloatArray


@inner
def draw(random: RandomState) -> float:
    """Next uniform number in [0, 1) of a xorshift generator whose state is ``(1,)`` and not zero."""
    x = random[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    random[0] = x
    uniform: float = np.float64(x * np.uint64(2685821657736338717) >> np.uint64(11)) / 9007199254740992.0
    return uniform


@inner
def read(r: int, s: State, tables: Tables) -> None:
    """Read the sequence of robot r: drop what it cannot serve, and set all that `State` says of it.

    Its value is coverage less sigma times all the energy spent until the horizon.
    """
    horizon, sigma, reward = tables.horizon, tables.sigma, tables.reward
    steps, energy_j = tables.steps, tables.energy_j
    at, t, back = tables.whole[r, 0], tables.whole[r, 1], tables.whole[r, 2]
    spare_j, wait_j, sense_j = tables.joules[r, 0], tables.joules[r, 1], tables.joules[r, 2]
    order, arrival, slope, moment = s.order[r], s.arrival[r], s.slope[r], s.moment[r]
    spent, value, kept = 0.0, 0.0, 0
    s.joule[r] = 0.0
    slope[0], moment[0] = 0.0, 0.0
    for k in range(s.lengths[r]):
        cell = order[k]
        then = t + steps[at, cell]
        idle = 0.0
        if then < 1:
            then, idle = 1, wait_j
        s.owner[cell] = -1
        if then > horizon:
            continue
        earned = reward[cell, then]
        if earned <= 0.0 or earned <= sigma * sense_j:
            continue
        after = spent + energy_j[at, cell] + idle + sense_j
        rest = horizon - then
        last_j = 0.0
        if back >= 0:
            rest -= steps[cell, back]
            last_j = energy_j[cell, back]
        if rest < 0 or after + last_j + rest * wait_j > spare_j:
            continue
        s.owner[cell] = r
        s.position[cell] = kept
        order[kept] = cell
        arrival[kept] = then
        kept += 1
        value += earned
        decay = earned
        if then < horizon and reward[cell, then + 1] > 0.0:
            decay -= reward[cell, then + 1]
        slope[kept] = slope[kept - 1] + decay
        moment[kept] = moment[kept - 1] + decay * then
        if after > spent:
            s.joule[r] = earned / (after - spent)
        spent, at, t = after, cell, then
    s.lengths[r] = kept
    rest = horizon - t
    if back >= 0:
        spent += energy_j[at, back]
        rest -= steps[at, back]
    s.values[r] = value - sigma * (spent + rest * wait_j)
    s.slack_j[r] = spare_j - spent - rest * wait_j


@inner
def _delay(s: State, r: int, first: int, later: float) -> float:
    """Estimated loss when everything of robot r from position ``first`` on comes ``later`` steps later."""
    loss: float = later * (s.slope[r, s.lengths[r]] - s.slope[r, first])
    return loss


@inner
def keep(r: int, s: State, old: State) -> None:
    """Keep the sequence of a robot before it is changed."""
    old.lengths[r] = s.lengths[r]
    old.values[r] = s.values[r]
    for k in range(s.lengths[r]):
        old.order[r, k] = s.order[r, k]


@inner
def swap_tails(a: int, b: int, bar: float, s: State, old: State, tables: Tables) -> bool:
    """Let b and what follows it come after a, and what followed a come where b was (two robots).

    Like every move here: nothing is done and False returned when it looks worse than ``bar``.
    """
    steps = tables.steps
    ra, rb, ia, ib = s.owner[a], s.owner[b], s.position[a], s.position[b]
    length_a, length_b = s.lengths[ra], s.lengths[rb]
    estimate = -_delay(s, rb, ib, s.arrival[ra, ia] + steps[a, b] - s.arrival[rb, ib])
    if ia + 1 < length_a:
        follower = s.order[ra, ia + 1]
        if ib > 0:
            free = s.arrival[rb, ib - 1] + steps[s.order[rb, ib - 1], follower]
        else:
            free = tables.whole[rb, 1] + steps[tables.whole[rb, 0], follower]
        estimate -= _delay(s, ra, ia + 1, free - s.arrival[ra, ia + 1])
    if estimate < bar:
        return False
    keep(ra, s, old)
    keep(rb, s, old)
    for k in range(length_b - ib):
        s.order[ra, ia + 1 + k] = old.order[rb, ib + k]
    for k in range(length_a - ia - 1):
        s.order[rb, ib + k] = old.order[ra, ia + 1 + k]
    s.lengths[ra] = ia + 1 + length_b - ib
    s.lengths[rb] = ib + length_a - ia - 1
    return True


@inner
def reverse(a: int, b: int, bar: float, s: State, old: State, tables: Tables) -> bool:
    """Drive backwards what lies between a and b, of one robot, so that they become neighbours."""
    steps = tables.steps
    r = s.owner[a]
    order, arrival = s.order[r], s.arrival[r]
    ia, ib = s.position[a], s.position[b]
    low, high = (ia + 1, ib) if ia < ib else (ib, ia - 1)
    if low >= high:
        return False
    if low > 0:
        begin = arrival[low - 1] + steps[order[low - 1], order[high]]
    else:
        begin = tables.whole[r, 1] + steps[tables.whole[r, 0], order[high]]
    # Position q is reached at begin + arrival[high] - arrival[q] (ways back take as long as ways there).
    weight = s.slope[r, high + 1] - s.slope[r, low]
    estimate = 2.0 * (s.moment[r, high + 1] - s.moment[r, low]) - (begin + arrival[high]) * weight
    if high + 1 < s.lengths[r]:
        end = begin + arrival[high] - arrival[low] + steps[order[low], order[high + 1]]
        estimate -= _delay(s, r, high + 1, end - arrival[high + 1])
    if estimate < bar:
        return False
    keep(r, s, old)
    for k in range(low, high + 1):
        order[k] = old.order[r, low + high - k]
    return True


@inner
def shift(a: int, b: int, size: int, flip: bool, bar: float, s: State, old: State, tables: Tables) -> bool:
    """Move ``size`` cells from b on (or, driven backwards, up to b) behind a."""
    steps = tables.steps
    ra, rb, ia, ib = s.owner[a], s.owner[b], s.position[a], s.position[b]
    first = max(0, ib - size + 1) if flip else ib
    last = ib if flip else min(ib + size, s.lengths[rb]) - 1
    if ra == rb and first - 1 <= ia <= last:
        return False
    size = last - first + 1
    length = s.lengths[rb]
    arrival, order = s.arrival[rb], s.order[rb]
    tail_end = order[first] if flip else order[last]
    duration = arrival[last] - arrival[first]
    if first > 0:
        before, left = order[first - 1], arrival[first - 1]
    else:
        before, left = tables.whole[rb, 0], tables.whole[rb, 1]
    estimate = 0.0
    earlier = 0  # by how much what follows the string comes later once it is gone
    if last + 1 < length:
        earlier = left + steps[before, order[last + 1]] - arrival[last + 1]
    join = s.arrival[ra, ia] + steps[a, b]
    if ra == rb and ia > last:
        join += earlier
    if flip:
        weight = s.slope[rb, last + 1] - s.slope[rb, first]
        estimate += 2.0 * (s.moment[rb, last + 1] - s.moment[rb, first]) - (join + arrival[last]) * weight
    else:
        estimate -= (join - arrival[first]) * (s.slope[rb, last + 1] - s.slope[rb, first])
    later = 0
    if ia + 1 < s.lengths[ra]:
        later = join + duration + steps[tail_end, s.order[ra, ia + 1]] - s.arrival[ra, ia + 1]
    if ra != rb:
        if last + 1 < length:
            estimate -= _delay(s, rb, last + 1, earlier)
        if ia + 1 < s.lengths[ra]:
            estimate -= _delay(s, ra, ia + 1, later)
    elif ia > last:
        estimate -= earlier * (s.slope[rb, ia + 1] - s.slope[rb, last + 1])
        if ia + 1 < length:
            estimate -= _delay(s, rb, ia + 1, later)
    else:
        estimate -= later * (s.slope[rb, first] - s.slope[rb, ia + 1])
        if last + 1 < length:
            estimate -= _delay(s, rb, last + 1, later + earlier)
    if estimate < bar:
        return False
    keep(ra, s, old)
    if ra != rb:
        keep(rb, s, old)
    for k in range(first, length - size):
        s.order[rb, k] = s.order[rb, k + size]
    s.lengths[rb] -= size
    if ra == rb and ia > last:
        ia -= size
    for k in range(s.lengths[ra] - 1, ia, -1):
        s.order[ra, k + size] = s.order[ra, k]
    for k in range(size):
        s.order[ra, ia + 1 + k] = old.order[rb, last - k] if flip else old.order[rb, first + k]
    s.lengths[ra] += size
    return True


@inner
def join(a: int, b: int, bar: float, s: State, old: State, tables: Tables) -> bool:
    """Serve b, which nobody serves, right after a."""
    r, ia = s.owner[a], s.position[a]
    then = s.arrival[r, ia] + tables.steps[a, b]
    if then > tables.horizon:
        return False
    estimate = tables.reward[b, then]
    if ia + 1 < s.lengths[r]:
        later = then + tables.steps[b, s.order[r, ia + 1]] - s.arrival[r, ia + 1]
        estimate -= _delay(s, r, ia + 1, later)
    if estimate < bar:
        return False
    keep(r, s, old)
    for k in range(s.lengths[r], ia + 1, -1):
        s.order[r, k] = s.order[r, k - 1]
    s.order[r, ia + 1] = b
    s.lengths[r] += 1
    return True


@inner
def skip(b: int, bar: float, s: State, old: State, tables: Tables) -> bool:
    """No longer serve b."""
    r, ib = s.owner[b], s.position[b]
    estimate = -tables.reward[b, s.arrival[r, ib]]
    if ib + 1 < s.lengths[r]:
        follower = s.order[r, ib + 1]
        if ib > 0:
            then = s.arrival[r, ib - 1] + tables.steps[s.order[r, ib - 1], follower]
        else:
            then = tables.whole[r, 1] + tables.steps[tables.whole[r, 0], follower]
        estimate -= _delay(s, r, ib + 1, then - s.arrival[r, ib + 1])
    if estimate < bar:
        return False
    keep(r, s, old)
    for k in range(ib, s.lengths[r] - 1):
        s.order[r, k] = s.order[r, k + 1]
    s.lengths[r] -= 1
    s.owner[b] = -1
    return True

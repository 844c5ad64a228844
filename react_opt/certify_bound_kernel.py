"""The compiled part of the dynamic programme that recomputes a bound: partial routes, instant by instant.

It is plain on purpose: at each instant and in each cell it fetches what arrives there, collects the cell, and keeps
what no other partial route beats. It shares nothing with the solver's pricing.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MARGIN = 1e-9
MOST_TRIED = 16  # of the most valuable partial routes are compared with the others
HASH = np.int64(0x9E3779B97F4A7C1)


class Ways(NamedTuple):
    """Arcs by the cell that they lead to, and how the memory changes on them.

    Arcs into cell i are those of ``begin[i]`` up to ``begin[i + 1]``: ``origin``, ``steps``, ``energy_j``. What is
    remembered at both ends of arc a are the bits ``bit_from[k]`` at its beginning and ``bit_to[k]`` at its end, k from
    ``carry[a]`` up to ``carry[a + 1]``.
    """

    begin: Ints
    origin: Ints
    steps: Ints
    energy_j: Floats
    carry: Ints
    bit_from: Ints
    bit_to: Ints


class Memory(NamedTuple):
    """Cells remembered in i: ``cells[k]``, ``ahead[k]`` steps away, k from ``begin[i]`` up to ``begin[i + 1]``.

    ``own[i]`` is the bit of the cell itself; of the cuts, ``held[i]`` are those whose state survives in i (a bit for
    each), ``inside[i]`` those that hold i.
    """

    begin: Ints
    cells: Ints
    ahead: Ints
    own: Ints
    held: Ints
    inside: Ints


class Worth(NamedTuple):
    """What things are worth, ``(T + 1, n)``: collecting (after prices), ``later`` the most from then on (T + 2 rows).

    ``stand`` and ``slot`` are the prices of standing and of charging, ``rest[k]`` the most that the rest of a route is
    worth where each joule costs ``rate[k]`` besides; ``cut`` holds the prices of the cuts. ``potential``, ``(n,)`` or
    empty, are prices at which ``rest`` holds besides, where all cells are remembered, each by its own bit.
    """

    gain: Floats
    later: Floats
    stand: Floats
    slot: Floats
    rest: Floats
    rate: Floats
    cut: Floats
    potential: Floats


class Battery(NamedTuple):
    """Energy: ``budget`` J may be used, ``full`` is used when the battery is full; ``limited``: it may run short.

    Cell i charges ``amount[i]`` J per step; ``yet`` and ``rich``, ``(T + 1, n)`` or empty where nothing charges: the
    most that can be charged from then on, and the use up to which it cannot run short any more.
    """

    sigma: float
    idle_j: float
    sense_j: float
    budget: float
    full: float
    limited: bool
    amount: Floats
    yet: Floats
    rich: Floats


class Layers(NamedTuple):
    """Partial routes kept so far, those at instant t in cell i from ``begin[t, i]`` up to ``end[t, i]``."""

    begin: Ints
    end: Ints
    value: Floats
    memory: Ints
    cuts: Ints
    used_j: Floats


@kernel
def _longer(array: Any, least: int) -> Any:
    more = np.empty(max(least, 2 * len(array)), dtype=array.dtype)
    more[: len(array)] = array
    return more


@kernel
def _hopeful(t: int, i: int, value: float, memory: int, used_j: float, worth: Worth, battery: Battery, best: float,
             ) -> bool:  # fmt: skip
    """Return whether a partial route that has come to a cell may still end above ``best``."""
    if used_j > battery.budget:
        return False
    for cell in range(len(worth.potential)):
        if not (memory >> cell) & 1:
            value += worth.potential[cell]
    least = best + MARGIN * max(1.0, abs(best))
    for k in range(len(worth.rate)):
        left_j = (battery.budget if worth.rate[k] >= 0.0 else battery.full) - used_j
        if value + worth.rest[k, t, i] + worth.rate[k] * left_j <= least:
            return False
    return True


@kernel
def _beats(a: int, b: int, new: Any, size: int, loss: Floats, yet: float, rich: float, worth: Worth, battery: Battery,
           ) -> bool:  # fmt: skip
    """Return whether partial route a beats b, whatever comes next.

    One that remembers more, or has more odd cuts, still beats another if it is ahead by all that the other could gain
    from that: ``loss`` is the most that each remembered cell can still earn. Where ``yet`` joules can be charged, the
    other may make up by them for having less battery, and for sensing what the first leaves out. One that has used no
    more than ``rich`` cannot run short, so that it need not have more battery than the other.
    """
    value, memory, cuts, used_j = new
    lead = value[a] - value[b]
    if lead < 0.0 or (battery.limited and used_j[a] > used_j[b] and used_j[a] > rich):
        return False
    alone = memory[a] & ~memory[b]
    ahead_j = max(0.0, used_j[b] - used_j[a])
    if alone != 0:
        for k in range(size):
            if (alone >> k) & 1:
                lead -= loss[k]
                ahead_j += battery.sense_j
        if lead < 0.0:
            return False
    odd = cuts[a] & ~cuts[b]
    if odd != 0:
        for k in range(len(worth.cut)):
            if (odd >> k) & 1:
                lead -= worth.cut[k]
    return bool(lead >= battery.sigma * min(ahead_j, yet))


@kernel
def _roomy(new: Any, least: int) -> Any:
    """Return the arrays of partial routes with room for at least so many."""
    value, memory, cuts, used_j = new
    if least <= len(value):
        return new
    return _longer(value, least), _longer(memory, least), _longer(cuts, least), _longer(used_j, least)


@kernel
def _fetch(t: int, i: int, a: int, count: int, new: Any, ways: Ways, memory_of: Memory, worth: Worth, battery: Battery,
           layers: Layers, best: float) -> Any:  # fmt: skip
    """Add what arrives in cell i by arc a, or by waiting (a < 0); return the new end.

    What cannot end above ``best`` is left out, but where the battery is charged first.
    """
    source = t - (1 if a < 0 else ways.steps[a])
    origin = i if a < 0 else ways.origin[a]
    energy_j = battery.idle_j if a < 0 else ways.energy_j[a]
    if source < 0:
        return count, new
    first, final = layers.begin[source, origin], layers.end[source, origin]
    new = _roomy(new, count + final - first)
    value, memory, cuts, used_j = new
    charges = a < 0 and battery.amount[i] > 0.0
    for k in range(first, final):
        value[count] = layers.value[k] - battery.sigma * energy_j - worth.stand[t, i]
        used_j[count] = layers.used_j[k] + energy_j
        memory[count], cuts[count] = layers.memory[k], layers.cuts[k]
        if a >= 0:
            word = np.int64(0)
            for bit in range(ways.carry[a], ways.carry[a + 1]):
                word |= ((layers.memory[k] >> ways.bit_from[bit]) & 1) << ways.bit_to[bit]
            memory[count], cuts[count] = word, layers.cuts[k] & memory_of.held[i]
        if charges or _hopeful(t, i, value[count], memory[count], used_j[count], worth, battery, best):
            count += 1
    return count, new


@kernel
def _collect(t: int, i: int, begin: int, end: int, new: Any, memory_of: Memory, worth: Worth, sense_j: float) -> Any:
    """Add the twins that collect cell i to the partial routes from ``begin`` up to ``end``; return the new end."""
    if worth.gain[t, i] == -np.inf:
        return end, new
    new = _roomy(new, 2 * end - begin)
    value, memory, cuts, used_j = new
    own, inside, fill = np.int64(1) << memory_of.own[i], memory_of.inside[i], end
    for k in range(begin, end):
        if memory[k] & own:
            continue
        value[fill] = value[k] + worth.gain[t, i]
        due = cuts[k] & inside
        if due != 0:
            for cut in range(len(worth.cut)):
                if (due >> cut) & 1:
                    value[fill] -= worth.cut[cut]
        memory[fill], cuts[fill], used_j[fill] = memory[k] | own, cuts[k] ^ inside, used_j[k] + sense_j
        fill += 1
    return fill, new


@kernel
def _charge(t: int, i: int, begin: int, end: int, new: Any, worth: Worth, battery: Battery, best: float) -> Any:
    """Charge what has waited in cell i, from ``begin`` on; where that has a price, leave it out too."""
    price, most = worth.slot[t, i], end
    if price > 0.0:
        most = 2 * end - begin
        new = _roomy(new, most)
    value, memory, cuts, used_j = new
    for k in range(end, most):
        same = k - end + begin
        value[k], memory[k], cuts[k], used_j[k] = value[same], memory[same], cuts[same], used_j[same]
    fill = begin
    for k in range(begin, most):
        credit = 0.0 if k >= end else max(0.0, min(battery.amount[i], used_j[k] - battery.full))
        left = value[k] + battery.sigma * credit - (price if credit > 0.0 else 0.0)
        used = used_j[k] - credit
        if _hopeful(t, i, left, memory[k], used, worth, battery, best):
            value[fill], memory[fill], cuts[fill], used_j[fill] = left, memory[k], cuts[k], used
            fill += 1
    return fill, new


@kernel
def _cleared(table: Ints, count: int) -> Any:
    """Return an empty hash table for so many."""
    while len(table) < 2 * count:
        table = np.empty(2 * len(table), np.int64)
    table[:] = -1
    return table


@kernel
def _place(k: int, new: Any, table: Ints) -> Any:
    """Return the place in the hash table of the memory and cuts of partial route k, where another may stand."""
    _, memory, cuts, _ = new
    mask = len(table) - 1
    place = (memory[k] * HASH + cuts[k]) * HASH
    place = (place ^ (place >> 29)) & mask
    while table[place] >= 0 and (memory[table[place]] != memory[k] or cuts[table[place]] != cuts[k]):
        place = (place + 1) & mask
    return place


@kernel
def _distinct(count: int, new: Any, table: Ints) -> Any:
    """Keep the most valuable of those with the same memory and cuts; return how many are left, and the hash table."""
    value, memory, cuts, used_j = new
    table, fill = _cleared(table, count), 0
    for k in range(count):
        place = _place(k, new, table)
        same = table[place]
        newcomer = same < 0
        if newcomer:
            table[place] = same = fill
            fill += 1
        if newcomer or value[k] > value[same]:
            value[same], memory[same], cuts[same], used_j[same] = value[k], memory[k], cuts[k], used_j[k]
    return fill, table


@kernel
def _unbeaten(t: int, i: int, count: int, new: Any, memory_of: Memory, worth: Worth, battery: Battery, loss: Floats,
              table: Ints) -> Any:  # fmt: skip
    """Return those that no other beats, the most valuable first, and the hash table.

    Each is compared with the most valuable ones and with that of the same memory and cuts which used the least energy.
    """
    value, used_j = new[0], new[3]
    size, last = memory_of.begin[i + 1] - memory_of.begin[i], len(worth.gain) - 1
    for k in range(size):
        place = memory_of.begin[i] + k
        loss[k] = worth.later[min(t + memory_of.ahead[place], last + 1), memory_of.cells[place]]
    yet, rich = 0.0, -np.inf
    if len(battery.yet) > 0:
        yet, rich = battery.yet[t, i], battery.rich[t, i]
    table = _cleared(table, count)
    order, kept = np.argsort(-value[:count]), 0
    for k in range(count):
        b = order[k]
        if used_j[b] > battery.budget:
            continue
        place = _place(b, new, table)
        same = table[place]
        beaten = same >= 0 and _beats(same, b, new, size, loss, yet, rich, worth, battery)
        for m in range(min(kept, MOST_TRIED)):
            if beaten:
                break
            beaten = _beats(order[m], b, new, size, loss, yet, rich, worth, battery)
        if not beaten:
            order[kept] = b
            kept += 1
            if same < 0 or used_j[b] < used_j[same]:
                table[place] = b
    return order[:kept], table


@kernel
def _shifted(t: int, oldest: int, fill: int, layers: Layers) -> Any:
    """Forget what lies before instant ``oldest``, if that is half of all or more; return the new fill."""
    dead = layers.begin[oldest, 0] if oldest < t else 0
    if 2 * dead < fill or dead == 0:
        return fill
    for array in (layers.value, layers.used_j):
        for k in range(dead, fill):
            array[k - dead] = array[k]
    for words in (layers.memory, layers.cuts):
        for k in range(dead, fill):
            words[k - dead] = words[k]
    for s in range(oldest, t + 1):
        for j in range(layers.begin.shape[1]):
            layers.begin[s, j] -= dead
            layers.end[s, j] -= dead
    return fill - dead


@kernel
def advance(from_t: int, to_t: int, start: int, start_step: int, goal: int, best: float, ways: Ways, memory_of: Memory,
            worth: Worth, battery: Battery, layers: Layers, fill: int) -> Any:  # fmt: skip
    """Find what is kept at the instants from ``from_t`` up to ``to_t``, excluded.

    Returns
    -------
    best, layers, fill
        The most that a route is worth (at least ``best``), what is kept, and how far that fills its arrays.
    """
    n, last, longest = len(ways.begin) - 1, len(worth.gain) - 1, 1
    for a in range(len(ways.steps)):
        longest = max(longest, ways.steps[a])
    new = (np.empty(64), np.empty(64, np.int64), np.empty(64, np.int64), np.empty(64))
    loss, table = np.zeros(64), np.empty(64, np.int64)
    for t in range(from_t, to_t):
        for i in range(n):
            count = 0
            for a in range(ways.begin[i], ways.begin[i + 1]):
                count, new = _fetch(t, i, a, count, new, ways, memory_of, worth, battery, layers, best)
            charges = battery.amount[i] > 0.0
            if not charges:
                count, new = _fetch(t, i, -1, count, new, ways, memory_of, worth, battery, layers, best)
            if t == start_step and i == start:
                new[0][0], new[1][0], new[2][0], new[3][0] = -worth.stand[t, i], 0, 0, 0.0
                count = 1
            if not battery.limited:
                count, table = _distinct(count, new, table)
            count, new = _collect(t, i, 0, count, new, memory_of, worth, battery.sense_j)
            if not battery.limited:
                count, table = _distinct(count, new, table)
            if charges:
                stays = count
                count, new = _fetch(t, i, -1, count, new, ways, memory_of, worth, battery, layers, best)
                count, new = _collect(t, i, stays, count, new, memory_of, worth, battery.sense_j)
                count, new = _charge(t, i, stays, count, new, worth, battery, best)
            kept, table = _unbeaten(t, i, count, new, memory_of, worth, battery, loss, table)
            if fill + len(kept) > len(layers.value):  # what no arc can start from any more makes room
                fill = _shifted(t, max(start_step, t - longest), fill, layers)
            if fill + len(kept) > len(layers.value):
                least = fill + len(kept)
                layers = Layers(layers.begin, layers.end, _longer(layers.value, least), _longer(layers.memory, least),
                                _longer(layers.cuts, least), _longer(layers.used_j, least))  # fmt: skip
            layers.begin[t, i] = fill
            for k in kept:
                layers.value[fill], layers.memory[fill] = new[0][k], new[1][k]
                layers.cuts[fill], layers.used_j[fill] = new[2][k], new[3][k]
                fill += 1
            layers.end[t, i] = fill
            if t == last and len(kept) > 0 and (goal < 0 or goal == i):
                best = max(best, new[0][kept[0]])
    return best, layers, fill

"""The compiled search behind `beam.best_response`: labels by instant, their dominance and their expansion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.ranking import inner, ranking
from react_opt.solvers.routes.residual import Mask


@inner
def _grown(array, room):  # type: ignore[no-untyped-def]  # one body for several types
    larger = np.empty((room, array.shape[1]), dtype=array.dtype)
    for k in range(len(array)):
        for c in range(array.shape[1]):
            larger[k, c] = array[k, c]
    return larger


@inner
def _grown_1d(array, room):  # type: ignore[no-untyped-def]
    larger = np.empty(room, dtype=array.dtype)
    for k in range(len(array)):
        larger[k] = array[k]
    return larger


@inner
def _rehashed(slots: IntArray, hashes: NDArray[np.uint64], labels: int) -> IntArray:
    """Table of four times the size; later labels of a hash take the place of earlier ones, which they chain."""
    larger = np.full(4 * len(slots), -1, dtype=np.int64)
    for n in range(labels):
        slot = np.int64(hashes[n] & np.uint64(len(larger) - 1))
        while larger[slot] >= 0 and hashes[larger[slot]] != hashes[n]:
            slot = (slot + 1) & (len(larger) - 1)
        larger[slot] = n
    return larger


@kernel(nogil=True)
def beam(
    out_start: IntArray,
    arc_to: IntArray,
    arc_steps: IntArray,
    arc_energy_j: FloatArray,
    horizon: int,
    start: int,
    start_step: int,
    return_to: int,
    numbers: FloatArray,
    gain: FloatArray,
    need: FloatArray,
    ahead: FloatArray,
    price: FloatArray,
    drive: Mask,
    charge_j: FloatArray,
    mode: int,
    waits: bool,
    width: int,
    zobrist: NDArray[np.uint64],
) -> tuple[FloatArray, float, bool]:
    """Search; returns the best chain of labels (first to last), its value and whether nothing was cut off.

    Parameters
    ----------
    out_start, arc_to, arc_steps, arc_energy_j, horizon
        See `RouteProblem`.
    start, start_step, return_to
        See `RobotClass`.
    numbers
        Battery, capacity, reserve, energy of waiting and of sensing (J), sigma, multiplier of the battery's floor,
        value to beat, slack of battery comparisons (J). Values are coverage less sigma times energy spent.
    gain, drive, charge_j
        See `Leftover`.
    need
        Least battery to reach the horizon (`survival`).
    ahead, price
        Lagrangian potential and its cell prices.
    mode
        How the battery enters dominance: 0 not at all, 1 beside the value, 2 beside the coverage.
    waits
        Whether waiting before the end can be of use.
    width
        Labels kept per instant.
    zobrist
        ``(2, n_cells)`` random words of the hash of a cell and a set of cells.
    """
    battery_j, capacity_j, reserve_j = numbers[0], numbers[1], numbers[2]
    wait_j, sense_j, sigma = numbers[3], numbers[4], numbers[5]
    extra, floor, slack = numbers[6], numbers[7], numbers[8]
    n_cells = gain.shape[0]
    words = (n_cells + 63) // 64
    total_price = 0.0
    for cell in range(n_cells):
        total_price += price[cell]
    # Candidates: rank, value, battery, price of the collected, charge | cell, parent, arc, sensed, next | hash.
    room = 4096
    c_num = np.empty((room, 5))
    c_int = np.empty((room, 5), dtype=np.int64)
    c_hash = np.empty(room, dtype=np.uint64)
    used, free = 0, -1
    head = np.full(horizon + 1, -1, dtype=np.int64)
    # Labels: value, battery, price, charge | t, cell, parent, arc, sensed, next of the same hash | set, hash.
    space = 4096
    l_num = np.empty((space, 4))
    l_int = np.empty((space, 6), dtype=np.int64)
    l_set = np.empty((space, words), dtype=np.uint64)
    l_hash = np.empty(space, dtype=np.uint64)
    labels = 0
    slots = np.full(1 << 14, -1, dtype=np.int64)  # open addressing: hash -> last label of that hash
    in_cell = np.full(n_cells, -1, dtype=np.int64)
    next_in_cell = np.empty(space, dtype=np.int64)
    compare = 1 << 60 if width >= 1 << 40 else 48
    best, best_label = floor, -1
    complete = True

    for root in range(2):  # the start itself, not sensed and sensed
        sensed_gain = gain[start, start_step] - sigma * sense_j if root else 0.0
        if root and (gain[start, start_step] <= 0.0 or sensed_gain <= 0.0):
            continue
        b = battery_j - root * sense_j
        if b < need[start_step, start] - slack:
            continue
        paid = price[start] if root else 0.0
        c_num[used, 0] = sensed_gain + extra * (b - reserve_j) + ahead[start_step, start] - paid
        c_num[used, 1], c_num[used, 2], c_num[used, 3], c_num[used, 4] = sensed_gain, b, paid, 0.0
        c_int[used, 0], c_int[used, 1], c_int[used, 2], c_int[used, 3] = start, -1, -1, root
        c_int[used, 4] = head[start_step]
        c_hash[used] = zobrist[1, start] if root else np.uint64(0)
        head[start_step] = used
        used += 1

    for t in range(start_step, horizon + 1):
        count = 0
        c = head[t]
        while c >= 0:
            count += 1
            c = c_int[c, 4]
        if count == 0:
            continue
        batch = np.empty(count, dtype=np.int64)
        rank = np.empty(count)
        c = head[t]
        for k in range(count):
            batch[k] = c
            rank[k] = -c_num[c, 0]
            c = c_int[c, 4]
        order = ranking(rank)
        first_label = labels
        for position in range(count):
            c = batch[order[position]]
            if c_num[c, 0] + total_price <= best + 1e-9 * max(1.0, abs(best)):
                break
            cell = c_int[c, 0]
            value, b = c_num[c, 1], c_num[c, 2]
            key = c_hash[c] ^ zobrist[0, cell]
            if waits:
                key ^= np.uint64(t) * np.uint64(0x9E3779B97F4A7C15)
            slot = np.int64(key & np.uint64(len(slots) - 1))
            while slots[slot] >= 0 and l_hash[slots[slot]] != key:
                slot = (slot + 1) & (len(slots) - 1)
            # A label with the same cells collected, here before (it may wait until now) or now.
            dominated = False
            e = slots[slot]
            while e >= 0 and not dominated:
                idle = (t - l_int[e, 0]) * wait_j
                b_e, value_e = l_num[e, 1] - idle, l_num[e, 0] - sigma * idle
                if mode == 0:
                    dominated = value_e >= value
                elif mode == 1:
                    dominated = value_e >= value and b_e >= b
                else:
                    dominated = value_e - sigma * b_e >= value - sigma * b - 1e-12 and b_e >= b
                e = l_int[e, 5]
            if dominated:
                continue
            parent = c_int[c, 1]
            added = cell if c_int[c, 3] == 1 else -1
            e = in_cell[cell]
            tries = 0
            while e >= first_label and not dominated and tries < compare:
                tries += 1
                if mode == 0:
                    dominated = l_num[e, 0] >= value
                elif mode == 1:
                    dominated = l_num[e, 0] >= value and l_num[e, 1] >= b
                else:
                    dominated = l_num[e, 0] - sigma * l_num[e, 1] >= value - sigma * b - 1e-12 and l_num[e, 1] >= b
                if dominated:
                    for w in range(words):
                        held = l_set[parent, w] if parent >= 0 else np.uint64(0)
                        if added >> 6 == w:
                            held |= np.uint64(1) << np.uint64(added & 63)
                        if l_set[e, w] & ~held:
                            dominated = False
                            break
                e = next_in_cell[e]
            if dominated:
                continue
            if labels - first_label >= width:
                complete = False
                break
            if labels == space:
                space *= 2
                l_num = _grown(l_num, space)
                l_int = _grown(l_int, space)
                l_set = _grown(l_set, space)
                l_hash = _grown_1d(l_hash, space)
                next_in_cell = _grown_1d(next_in_cell, space)
            n = labels
            labels += 1
            l_num[n, 0], l_num[n, 1], l_num[n, 2], l_num[n, 3] = value, b, c_num[c, 3], c_num[c, 4]
            l_int[n, 0], l_int[n, 1], l_int[n, 2], l_int[n, 3] = t, cell, parent, c_int[c, 2]
            l_int[n, 4], l_int[n, 5] = c_int[c, 3], slots[slot]
            for w in range(words):
                l_set[n, w] = l_set[parent, w] if parent >= 0 else np.uint64(0)
            if added >= 0:
                l_set[n, added >> 6] |= np.uint64(1) << np.uint64(added & 63)
            l_hash[n] = key
            slots[slot] = n
            next_in_cell[n] = in_cell[cell]
            in_cell[cell] = n
            if 2 * labels > len(slots):
                slots = _rehashed(slots, l_hash, labels)
            if return_to < 0 or cell == return_to:  # it may stay here until the end
                idle = (horizon - t) * wait_j
                if (t == horizon or not waits) and b - idle >= reserve_j - slack and value - sigma * idle > best:
                    best, best_label = value - sigma * idle, n
            if t == horizon:
                continue

            own = c_hash[c]
            first_arc = out_start[cell]
            stay = waits or t == 0
            for a in range(first_arc - 1 if stay else first_arc, out_start[cell + 1]):
                charged = 0.0
                if a < first_arc:
                    arrival, there, arc, cost = t + 1, cell, -1, wait_j
                    if charge_j.size > 0:
                        charged = charge_j[arrival, there]
                else:
                    arrival, there, arc, cost = t + arc_steps[a], arc_to[a], a, arc_energy_j[a]
                    if arrival > horizon or (drive.size > 0 and not drive[t, a]):
                        continue
                if ahead[arrival, there] == -np.inf:
                    continue
                sensed_gain = gain[there, arrival] - sigma * sense_j
                bit = np.uint64(1) << np.uint64(there & 63)
                may_sense = gain[there, arrival] > 0.0 and sensed_gain > 0.0 and not (l_set[n, there >> 6] & bit)
                for sensed in range(1 if may_sense else 0, -1, -1):
                    drained = b - cost - sensed * sense_j
                    credit = min(charged, capacity_j - drained) if charged > 0.0 else 0.0
                    left = drained + credit
                    if left < need[arrival, there] - slack:
                        continue
                    worth = value - sigma * (cost - credit) + sensed * sensed_gain
                    paid = l_num[n, 2] + sensed * price[there]
                    ranked = worth + extra * (left - reserve_j) + ahead[arrival, there] - paid
                    if ranked + total_price > best + 1e-9 * max(1.0, abs(best)):
                        if free >= 0:
                            slot_c = free
                            free = c_int[free, 4]
                        else:
                            if used == room:
                                room *= 2
                                c_num = _grown(c_num, room)
                                c_int = _grown(c_int, room)
                                c_hash = _grown_1d(c_hash, room)
                            slot_c = used
                            used += 1
                        c_num[slot_c, 0], c_num[slot_c, 1], c_num[slot_c, 2] = ranked, worth, left
                        c_num[slot_c, 3], c_num[slot_c, 4] = paid, credit
                        c_int[slot_c, 0], c_int[slot_c, 1], c_int[slot_c, 2] = there, n, arc
                        c_int[slot_c, 3], c_int[slot_c, 4] = sensed, head[arrival]
                        c_hash[slot_c] = own ^ zobrist[1, there] if sensed else own
                        head[arrival] = slot_c
                    if sensed and mode == 0 and not waits:
                        break  # nothing is gained by not sensing
        for k in range(count):
            c_int[batch[k], 4] = free
            free = batch[k]

    if best_label < 0:
        return np.empty((0, 5)), best, complete
    length = 0
    e = best_label
    while e >= 0:
        length += 1
        e = l_int[e, 2]
    chain = np.empty((length, 5))
    e = best_label
    for k in range(length - 1, -1, -1):
        chain[k, 0], chain[k, 1], chain[k, 2] = l_int[e, 0], l_int[e, 1], l_int[e, 3]
        chain[k, 3], chain[k, 4] = l_int[e, 4], l_num[e, 3]
        e = l_int[e, 2]
    return chain, best, complete

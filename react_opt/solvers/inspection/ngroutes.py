"""Best ng-route of one robot for given prizes, in the order of what a budget has left: exact, for many targets.

Labels go from bucket to bucket of the main budget, so that nearly all that could beat a label are known before it
is extended. A label is beaten by one at the same target that has used no more of either budget, earns no less and
remembers no target that the other does not (Baldacci et al. 2011). Per target and bucket the largest profit is
kept: buckets that hold nothing as good are passed over.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from react_opt.kernels import kernel
from react_opt.solvers.inspection.labels import completion, still_ahead

BUCKETS = 160


@kernel
def _beaten(
    j: int, last: int, t: float, e: float, p: float, self: int, head: Any, after: Any, top: Any, used_t: Any,
    used_e: Any, profit: Any, mask: Any, words: int,
) -> bool:  # fmt: skip
    """Whether a label at target ``j`` (its memory in row ``self`` of ``mask``) is beaten by another."""
    least = p - 1e-12
    for b in range(last, -1, -1):
        if top[j, b] < least:
            continue
        other = head[j, b]
        while other >= 0:
            if profit[other] >= least and used_t[other] <= t and used_e[other] <= e and other != self:
                within = True
                for w in range(words):
                    within = within and (mask[other, w] & ~mask[self, w]) == np.uint64(0)
                if within:
                    return True
            other = after[other]
    return False


@kernel(nogil=True)
def best_ng_routes(
    prize: Any, rate: float, cost: Any, time_s: Any, energy_j: Any, time_limit: float, energy_limit: float,
    memory: Any, metric: bool, threshold: float, n_time: int, stop: Any, node: Any, parent: Any, profit: Any,
    mask: Any, final: Any, used_t: Any, used_e: Any, after: Any, queued: Any,
) -> int:  # fmt: skip
    """Extend labels until none is left; fill ``node, parent, profit, mask, final`` and return their number.

    Parameters are those of :func:`react_opt.solvers.inspection.labels.best_routes`; ``time_s`` is the main budget,
    by which labels are ordered, ``n_time`` the buckets of its completion bound, and ``queued`` room for the next
    label in a bucket. The number returned is negative where the room does not suffice or ``stop`` was set.
    """
    n, most = len(prize), len(node)
    words = mask.shape[1]
    gain = np.full((n + 2, n + 2), -np.inf)
    for i in range(n + 2):
        for j in range(n):
            gain[i, j] = prize[j] - rate * cost[i, j]
        gain[i, n + 1] = -rate * cost[i, n + 1]
    ahead, first, other = np.empty((0, 0)), np.empty((0, 0), np.int64), np.empty((0, 0))
    if n_time > 0:
        ahead, first, other = completion(prize, gain, time_s, time_limit, n_time)
    ahead_width = time_limit / max(1, n_time)
    width = max(time_limit, 1e-300) / BUCKETS
    head = np.full((n, BUCKETS + 1), -1, np.int64)
    top = np.full((n, BUCKETS + 1), -np.inf)
    queue, tail = np.full(BUCKETS + 1, -1, np.int64), np.full(BUCKETS + 1, -1, np.int64)
    one = np.uint64(1)
    node[0], parent[0], profit[0] = n, -1, 0.0
    used_t[0] = used_e[0] = 0.0
    mask[0, :] = np.uint64(0)
    for j in range(n):
        if prize[j] == -np.inf:
            mask[0, j >> 6] |= one << np.uint64(j & 63)
    fits = time_s[n, n + 1] <= time_limit and energy_j[n, n + 1] <= energy_limit
    final[0] = gain[n, n + 1] if fits else -np.inf
    queued[0] = -1
    queue[0] = tail[0] = 0
    count = 1
    for bucket in range(BUCKETS + 1):
        label = queue[bucket]
        while label >= 0:
            if stop[0] != 0:
                return -count
            i = node[label]
            if i < n and _beaten(
                i, bucket, used_t[label], used_e[label], profit[label], label, head, after, top, used_t, used_e, profit,
                mask, words,
            ):  # fmt: skip
                label = queued[label]
                continue
            for j in range(n):
                if (mask[label, j >> 6] >> np.uint64(j & 63)) & one:
                    continue
                t, e = used_t[label] + time_s[i, j], used_e[label] + energy_j[i, j]
                if t > time_limit or e > energy_limit:
                    continue
                if metric and (t + time_s[j, n + 1] > time_limit or e + energy_j[j, n + 1] > energy_limit):
                    continue
                p = profit[label] + gain[i, j]
                for w in range(words):
                    mask[count, w] = (mask[label, w] & memory[j, w]) | mask[0, w]
                mask[count, j >> 6] |= one << np.uint64(j & 63)
                if n_time > 0 and p + still_ahead(ahead, first, other, j, t, ahead_width, mask, count) <= threshold:
                    continue
                b = min(int(t / width), BUCKETS)
                if metric:
                    for k in range(n):
                        if not (mask[count, k >> 6] >> np.uint64(k & 63)) & one and (
                            t + time_s[j, k] + time_s[k, n + 1] > time_limit
                            or e + energy_j[j, k] + energy_j[k, n + 1] > energy_limit
                        ):
                            mask[count, k >> 6] |= one << np.uint64(k & 63)
                if _beaten(j, b, t, e, p, count, head, after, top, used_t, used_e, profit, mask, words):
                    continue
                node[count], parent[count], profit[count] = j, label, p
                used_t[count], used_e[count] = t, e
                fits = t + time_s[j, n + 1] <= time_limit and e + energy_j[j, n + 1] <= energy_limit
                final[count] = p + gain[j, n + 1] if fits else -np.inf
                after[count] = head[j, b]
                head[j, b] = count
                top[j, b] = max(top[j, b], p)
                queued[count] = -1
                if tail[b] >= 0:
                    queued[tail[b]] = count
                else:
                    queue[b] = count
                tail[b] = count
                count += 1
                if count >= most:
                    return -count
            label = queued[label]
    return count

"""The choice among enumerated routes, against trying all of them."""

from itertools import product

import numpy as np
import pytest

from react_opt.certify_bound_choice import best_of
from react_opt.certify_bound_enumerate import Found
from react_opt.solvers.routes.choice import Pool, best_choice


def _case(seed: int) -> tuple[Pool, np.ndarray, np.ndarray, np.ndarray, float]:
    """Random routes, prices and a bound that they prove: value, loss and set of each route fit together."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 70))
    counts = [(1,), (2,), (3,), (1, 2)][seed % 4]
    price = np.where(rng.random(n) < 0.7, rng.integers(0, 9, n), 0).astype(np.float64)
    group = np.sort(rng.integers(0, len(counts), 24))
    share = rng.uniform(0.1, 0.6)
    inside = rng.random((24, n)) < share
    inside[rng.integers(24)] = False
    reduced = -rng.integers(0, 12, 24).astype(np.float64)
    best = np.array([max(reduced[group == k], default=0.0) for k in range(len(counts))])
    value, loss = reduced + inside @ price, best[group] - reduced
    order = np.argsort(loss, kind="stable")
    padded = np.zeros((24, 64 * ((n + 63) // 64)), np.uint8)
    padded[:, :n] = inside
    sets = np.packbits(padded, axis=1, bitorder="little").view(np.uint64)
    bound = float(price.sum() + np.array(counts) @ best)
    pool = Pool(value[order], loss[order], group[order].astype(np.int64), np.ascontiguousarray(sets[order]))
    return pool, inside[order], np.array(counts, np.int64), price, bound


def _by_trying(pool: Pool, inside: np.ndarray, counts: np.ndarray) -> float:
    """Return the best value of routes that are apart, one for each robot."""
    robots = np.repeat(np.arange(len(counts)), counts)
    best = -np.inf
    for chosen in product(*(np.flatnonzero(pool.group == k) for k in robots)):
        if inside[list(chosen)].sum(axis=0).max() <= 1:
            best = max(best, float(pool.value[list(chosen)].sum()))
    return best


@pytest.mark.parametrize("seed", range(40))
def test_the_best_choice_is_that_of_trying_all(seed: int) -> None:
    """With everything to lose the search finds the best choice, and nothing where the floor is that good already."""
    pool, inside, counts, price, bound = _case(seed)
    wanted = _by_trying(pool, inside, counts)
    going = np.zeros(1, np.uint8)
    floor = -1000.0
    chosen, worth, complete = best_choice(pool, counts, price, bound - floor, floor, 10**8, going)
    assert complete
    if wanted == -np.inf:
        assert worth == floor
        return
    assert worth == pytest.approx(wanted)
    assert sorted(pool.group[chosen]) == sorted(np.repeat(np.arange(len(counts)), counts))
    assert inside[chosen].sum(axis=0).max() <= 1
    _, above, complete = best_choice(pool, counts, price, bound - wanted, wanted, 10**8, going)
    assert complete
    assert above == wanted
    _, below, _ = best_choice(pool, counts, price, bound - wanted + 1.0, wanted - 1.0, 10**8, going)
    assert below == pytest.approx(wanted)


@pytest.mark.parametrize("seed", range(40))
def test_the_checkers_search_agrees(seed: int) -> None:
    """The plain search of the checker finds the same value, or the floor where nothing is above it."""
    pool, inside, counts, price, bound = _case(seed)
    wanted = _by_trying(pool, inside, counts)
    best = [float(max(pool.value[pool.group == k] - inside[pool.group == k] @ price, default=0.0)) for k in (0, 1)]
    found = [
        Found(pool.sets[mine], pool.value[mine] - inside[mine] @ price, pool.value[mine])
        for mine in (pool.group == k for k in range(len(counts)))
    ]
    for floor in (-1000.0, wanted - 1.0, wanted):
        if floor > -np.inf:
            worth = best_of(found, best[: len(counts)], counts.tolist(), price, bound - floor, floor)
            assert worth == pytest.approx(max(floor, wanted))


def test_a_search_that_is_given_up_says_so() -> None:
    """No work, or a flag that is set, and the search is not complete."""
    pool, _, counts, price, bound = _case(2)
    assert not best_choice(pool, counts, price, bound, 0.0, 0, np.zeros(1, np.uint8))[2]
    assert not best_choice(pool, counts, price, bound, 0.0, 10**8, np.ones(1, np.uint8))[2]


@pytest.mark.parametrize("seed", range(3))
def test_both_searches_agree_on_long_lists(seed: int) -> None:
    """Among more routes than one block or sample holds both find the same choice, where a cell may be left and not."""
    rng = np.random.default_rng(seed)
    n, m, counts = 40, 20_000, np.array([2, 1], np.int64)
    first, length = rng.integers(0, n, m), rng.integers(8, 20, m)
    inside = ((np.arange(n) - first[:, None]) % n < length[:, None]) & (rng.random((m, n)) < 0.97)
    loss = np.sort(rng.exponential(1.0, m))
    loss[0] = 0.0
    group = rng.integers(0, 2, m)
    group[:2] = 0, 1
    loss[1] = 0.0
    price = rng.uniform(0.05, 2.0, n)
    padded = np.zeros((m, 64), np.uint8)
    padded[:, :n] = inside
    sets = np.packbits(padded, axis=1, bitorder="little").view(np.uint64)
    value = inside @ price - loss
    bound = float(price.sum())
    pool = Pool(value, loss, group, sets)
    for losable in (0.5, 1.5):
        floor = bound - losable
        chosen, worth, complete = best_choice(pool, counts, price, losable, floor, 10**9, np.zeros(1, np.uint8))
        assert complete
        if chosen[0] >= 0:
            assert value[chosen].sum() == pytest.approx(worth)
            assert inside[chosen].sum(axis=0).max() <= 1
        found = [Found(sets[group == k], -loss[group == k], value[group == k]) for k in (0, 1)]
        assert best_of(found, [0.0, 0.0], counts.tolist(), price, losable, floor) == pytest.approx(worth)
    assert worth > floor

"""A line search for a convex function of one number."""

from __future__ import annotations

from collections.abc import Callable


def lowest_point(function: Callable[[float], float], guess: float, top: float) -> float:
    """Return roughly where a convex function of a number between 0 and ``top`` is least.

    Around a guess that is already good few evaluations suffice.

    Parameters
    ----------
    function
        The function.
    guess
        Where the point may lie; not positive if nothing is known.
    top
        The largest number looked at.
    """
    low, high = 0.0, top
    if guess > 0.0:
        low, high = 0.7 * guess, 1.4 * guess
        at_low, at_guess, at_high = function(low), function(guess), function(high)
        if at_low >= at_guess <= at_high:
            return guess
        low, high = (guess, top) if at_high < at_guess else (0.0, guess)
    for _ in range(12):
        left, right = low + 0.4 * (high - low), low + 0.6 * (high - low)
        if function(left) <= function(right):
            high = right
        else:
            low = left
    return 0.5 * (low + high)

"""Compiled kernels: one typed decorator around numba, and whether this machine's cache is warm."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, overload

from numba import njit

_P = ParamSpec("_P")
_R = TypeVar("_R")


@overload
def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]: ...


@overload
def kernel(**options: Any) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]: ...


def kernel(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function with numba and cache the result on disk.

    Parameters
    ----------
    function
        The function to compile; its types are inferred at its first call.
    **options
        Further options of ``numba.njit``, for instance ``parallel=True``.
    """
    decorate = njit(cache=True, **options)
    return decorate if function is None else decorate(function)

"""The route problem lives in :mod:`react_opt.route_problem`; import it from there."""

from react_opt.route_problem import FloatArray, IntArray, RobotClass, Route, RouteProblem

__all__ = ["FloatArray", "IntArray", "RobotClass", "Route", "RouteProblem"]

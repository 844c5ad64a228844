"""Campaigns of simulated missions and the tables made of them (``python -m benchmarks.missions``)."""

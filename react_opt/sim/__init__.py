"""The simulated building and its robots: a mission driven by a strategy that sees its belief alone."""

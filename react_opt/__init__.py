"""react_opt: planning engine for battery-powered robot fleets that explore a building against the clock."""

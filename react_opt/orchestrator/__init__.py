"""Who goes where, decided from what the fleet believes: the same strategies drive simulated and real robots."""

"""How far from the best possible: proven bounds on the time of coverage, and plans made with the whole map known."""

"""Learning of what to believe, from what the simulation knows."""

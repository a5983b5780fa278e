"""Training of agents: all that imports torch."""

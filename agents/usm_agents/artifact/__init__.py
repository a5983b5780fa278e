"""Files of trained agents, free of torch."""

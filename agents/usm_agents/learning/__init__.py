"""Training of agents. What imports torch and Stable-Baselines3 is in `sb3`."""

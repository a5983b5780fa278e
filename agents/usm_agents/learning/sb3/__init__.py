"""Stable-Baselines3 as the learner: the only part that imports torch."""

"""Stable-Baselines3 as the learner: all that imports torch."""

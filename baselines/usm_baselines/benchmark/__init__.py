"""Scores of many policies: leaderboard, robustness, tuning."""

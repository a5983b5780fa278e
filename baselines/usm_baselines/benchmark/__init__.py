"""Scores of many policies: results, leaderboard, robustness, tuning."""

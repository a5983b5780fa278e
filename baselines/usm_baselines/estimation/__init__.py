"""Observers, filters and predictions that control laws stand on."""

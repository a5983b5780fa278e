"""Compiled functions: how they are made and cached, and numbers for several robots side by side."""

"""The physics: compiled functions of arrays, which know numpy and numba only."""

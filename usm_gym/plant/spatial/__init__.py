"""The spatial plant: a chain of cylinders whose joints turn about any axis, in block kernels."""

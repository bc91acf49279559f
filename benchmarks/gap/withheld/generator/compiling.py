"""How the withheld car's code is compiled."""

from numba import njit

compiled = njit(cache=True, no_cfunc_wrapper=True)
"""Without the wrapper for C, which takes as long to compile as a small function: most take all of a car's numbers."""

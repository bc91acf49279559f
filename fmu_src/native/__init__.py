"""Units that need no Python in their host: C99 made of the estimator's Python source, and the FMI boundary in C.

`translator` reads typed functions and records, `build` packs the C into units.
"""

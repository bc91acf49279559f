"""The command line: arguments, progress and exit codes, nothing else."""

import os

# Before NumPy is loaded. Matrices are small here: threads of their products wait for each other more than they work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

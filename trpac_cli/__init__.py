"""The command line: arguments, progress and exit codes."""

import os

# Set before NumPy is imported: matrices are small, and threads of their products mostly wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

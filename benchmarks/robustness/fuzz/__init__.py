"""Rubbish into every input and every file that the project reads: ``python -m benchmarks.robustness.fuzz``."""

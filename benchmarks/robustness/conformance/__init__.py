"""Which client can do what with the units?

``python -m benchmarks.robustness.conformance`` writes docs/reference/conformance.md.
"""

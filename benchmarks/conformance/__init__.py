"""Which client can do what with the units: ``python -m benchmarks.conformance`` writes docs/conformance.md."""

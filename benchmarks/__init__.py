"""Measurements of the project; `benchmarks.blind` is the withheld-data check of the diagnosis."""

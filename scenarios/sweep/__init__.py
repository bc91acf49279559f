"""Monte-Carlo simulation of a scenario: draws, runs on Dask, results, report. Start at `files` and `run`."""

"""Monte-Carlo over a scenario: draws, runs, results on Dask, report. Start at `files` and `run`."""

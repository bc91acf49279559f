"""The estimator over recorded logs, as a user with a measurement has it."""

"""The estimator's parameters by name: bounds, units, and the configuration that their values make."""

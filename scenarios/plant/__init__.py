"""The reference plant: actuators, then dynamics, then sensors; see `pipeline` and `sensors`."""

"""The FMI boundary: slaves, their variables and the packaging; no physics."""

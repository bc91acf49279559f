"""The user's own plant, a co-simulation unit that is driven over the logs in the nominal model's place."""

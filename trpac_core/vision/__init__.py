"""The camera side: what the pictures say of the road ahead."""

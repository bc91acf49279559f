"""The camera chain: what its columns or pictures say of its own effects."""

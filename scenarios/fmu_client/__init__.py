"""Units by their files: archives that others wrote, opened, unpacked and run."""

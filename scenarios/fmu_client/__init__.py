"""Units in files: archives checked, unpacked, opened and run."""

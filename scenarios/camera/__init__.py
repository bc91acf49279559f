"""Rendered road pictures with exact labels, camera files and picture disturbances."""

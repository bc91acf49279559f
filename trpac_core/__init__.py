"""Estimation of the tyre-road peak adhesion coefficient from dynamics and camera."""

"""Diagnosis of the sim-to-real gap: where it lies, which unmodelled effect causes it, how far it shrinks with it."""

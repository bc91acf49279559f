"""Vehicles, roads and steps of diagnosis for logs that this project did not make; see lab/2026-11-29_gaps_of_foreign_logs.md."""

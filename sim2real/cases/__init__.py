"""Vehicles, roads and steps of diagnosis for logs that this project did not make; see docs/gap_real_logs.md."""

"""Vehicles, roads and steps of diagnosis for third-party logs; see lab/2026-11-29_gaps_of_foreign_logs.md."""

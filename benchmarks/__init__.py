"""Measurements: each module prints a table, side by side with a baseline, and may write docs/validation.md."""

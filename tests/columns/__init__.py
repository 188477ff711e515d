"""Processes: models, fits, relay experiments."""

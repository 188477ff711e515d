"""Settings whose meaning is uncertain."""

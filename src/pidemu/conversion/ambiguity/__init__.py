"""Settings whose meaning is uncertain: every reading of them."""

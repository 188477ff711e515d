"""Several controllers on the same signals."""

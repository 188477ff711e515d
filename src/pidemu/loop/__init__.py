"""Process models and the closed loop."""

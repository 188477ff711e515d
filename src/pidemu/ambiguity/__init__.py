"""Settings of which nobody is sure what they mean."""

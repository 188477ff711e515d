"""Processes from records of a test: reaction curves read by hand, and least squares."""

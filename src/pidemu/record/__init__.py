"""Recorded and standard signals: read, sampled, played to a controller."""

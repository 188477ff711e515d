"""Tuning rules as data, and their results in a card's dials."""

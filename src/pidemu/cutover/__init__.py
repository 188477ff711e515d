"""Changing over from one controller to another without a bump."""

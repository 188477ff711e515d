"""Scan programs as code in other languages."""

"""Rockwell exports (L5X): which loops they hold, with which settings, executed by what and how often.

`tree` reads the XML, `literals` its numbers and the bracketed text of values, `types` says where loops stand in user types and
Add-On Instructions, `blocks` reads a PID or PIDE, `execution` follows routines and tasks, `loops` puts them together, `readings`
makes loops for a job of them.
"""

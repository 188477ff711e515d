"""From a source's law to the numbers of a target: one file for each match (specs/equations.md, section 3)."""

"""Many closed loops at once: grouped by program, in blocks, on all cores of one machine or of a cluster."""

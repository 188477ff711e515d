"""Numbers that remember how they came about, so that what was computed for one loop is computed for many like it."""

"""One conversion under way: which match is tried with which filter, what is judged of it, and what comes of it."""

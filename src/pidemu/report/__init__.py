"""Reports: what a conversion amounts to, as a page to print."""

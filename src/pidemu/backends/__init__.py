"""Back ends that print or run a scan program."""

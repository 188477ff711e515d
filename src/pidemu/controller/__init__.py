"""A controller that runs, scan by scan or over records: its modes, events and bad signals."""

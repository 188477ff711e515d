"""Settings of a card: values with units, signal ranges, and reading what people type."""

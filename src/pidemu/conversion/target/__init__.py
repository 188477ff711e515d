"""What is free to choose on a target card, and how canonical numbers become its settings."""

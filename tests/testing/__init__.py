"""The public testing room, used as a stranger would."""

"""What stays the same between two controllers, what does not, and by how much."""

"""What a controller does scan by scan: programs, and the blocks they are built from."""

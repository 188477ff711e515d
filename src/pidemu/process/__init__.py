"""Processes: transfer functions with dead time, and their exact response between two scans."""

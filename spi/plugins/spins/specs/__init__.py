"""What spec files have for spins."""

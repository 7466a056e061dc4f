"""What spec files have for fluids."""

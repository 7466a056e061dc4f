"""Checks that every model and scheme must pass, whatever its equations."""

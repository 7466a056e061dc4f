"""The kinds of noise in specs."""

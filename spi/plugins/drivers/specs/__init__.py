"""Kinds of noise in specs."""

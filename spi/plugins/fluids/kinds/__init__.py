"""Vorticity in kinds of experiments."""

"""Lattices of spins in kinds of experiments."""

"""Lattices of spins in statistics."""

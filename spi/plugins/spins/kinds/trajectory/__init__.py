"""Lattices of spins in trajectories."""

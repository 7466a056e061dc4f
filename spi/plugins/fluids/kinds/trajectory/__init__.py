"""Vorticity in trajectories."""

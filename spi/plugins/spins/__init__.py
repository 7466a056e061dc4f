"""Lattices of classical spins, see README.md."""

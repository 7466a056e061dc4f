"""Panels of densities."""

"""Stationary laws on Casimir surfaces."""

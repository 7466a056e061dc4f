"""Schemes beside one another: work against error, and what they keep at large steps and extreme parameters."""

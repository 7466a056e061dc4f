"""Stored results as one HTML page, LaTeX tables and CSV."""

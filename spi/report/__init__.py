"""Stored results as tables and figures, and as one page."""

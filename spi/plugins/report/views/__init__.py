"""Page, its sections, and tables as LaTeX."""

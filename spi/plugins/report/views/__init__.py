"""The page, its sections, and tables as LaTeX."""

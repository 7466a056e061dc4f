"""Kind answer."""

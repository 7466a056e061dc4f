"""The kind answer."""

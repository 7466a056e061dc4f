"""Expectations and laws that need no sampling."""

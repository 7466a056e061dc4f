"""Shards of a run, and the verification of results."""

"""Runs on many machines: shards, Dask, and results that are checked by computing some of their paths again."""

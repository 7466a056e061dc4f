"""Poisson systems written in YAML: checked exactly, split into exact flows, generated as models in Python."""

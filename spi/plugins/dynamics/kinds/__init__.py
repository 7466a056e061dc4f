"""Kinds of experiments on dynamics."""

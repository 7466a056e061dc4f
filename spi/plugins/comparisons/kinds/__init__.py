"""Kinds of experiment of this plug-in."""

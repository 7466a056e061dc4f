"""Kinds of experiment to which this plug-in adds."""

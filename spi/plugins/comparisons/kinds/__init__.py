"""The kinds of experiment of this plug-in."""

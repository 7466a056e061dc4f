"""Expectations to a wanted accuracy: the program chooses schemes, steps and samples, or solves without sampling."""

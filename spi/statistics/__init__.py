"""Sums over paths, and what they tell: means, standard errors, orders, verdicts on claims."""

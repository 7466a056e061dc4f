"""Sums over paths, and the means, standard errors, orders and verdicts on claims that follow from them."""

"""Estimator of weak errors that does not sample."""

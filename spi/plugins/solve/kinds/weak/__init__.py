"""The estimator of weak errors that does not sample."""

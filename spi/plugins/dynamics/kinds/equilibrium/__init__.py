"""Means over time of long paths, their biases, histograms and autocorrelations."""

"""Cells, quantiles and autocorrelations."""

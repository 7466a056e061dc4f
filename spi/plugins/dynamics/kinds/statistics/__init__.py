"""Statistics of functions of the state over time: means with bands, variances, quantiles, histograms, covariances."""

"""Drivers of noises other than Brownian motion: coloured noise, fractional Brownian motion, increments of a file."""

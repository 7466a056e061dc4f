"""Elementary functions and random numbers for kernels."""

"""Energy spectra of means over paths and over time."""

"""Fluids on the torus: vorticity, its initial states, fields and spectra, see README.md."""

"""Expectations without sampling, on two-dimensional Casimir surfaces.

The backward operator of a splitting step, (P f)(y) = E f(y_1) given y_0 = y, is a product of operators f -> E f(flow),
one for each exact flow, and each of them is diagonal in a Fourier variable.  It is applied in the reverse order of the
flows.

The solver is chosen by a method of the model, see ``spi.ensemble.protocol``: ``axis_inertias`` for spheres,
``rotation_shear_rates`` for cylinders.
"""

"""Functions of records and their compilation to machine code; all code that relies on Numba's private parts."""

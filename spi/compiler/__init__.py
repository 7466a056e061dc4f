"""How functions of records become machine code; all that relies on Numba's private parts."""

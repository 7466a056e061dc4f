"""Files of spins in formats of other programs."""

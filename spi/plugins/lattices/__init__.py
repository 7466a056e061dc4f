"""Systems on so(3)^n written in YAML that are lattices of spins."""

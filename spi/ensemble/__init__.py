"""Many paths of one system along one Brownian path at several step sizes; begin with ``protocol``."""

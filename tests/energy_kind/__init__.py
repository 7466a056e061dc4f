"""A kind of experiment as one may be added: the mean of the Hamiltonian at the final time, for each step size."""

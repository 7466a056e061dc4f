"""What systems do in time: statistics, stationary laws, growth of invariants, and Lyapunov exponents."""

"""Lyapunov exponents: how fast near paths on the same noise part or meet."""

"""An answer to a wanted accuracy: E phi(y(T)), the scheme, steps, extrapolation and samples chosen by the program."""

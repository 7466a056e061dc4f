"""Laws of the increments, and noise that is made of them."""

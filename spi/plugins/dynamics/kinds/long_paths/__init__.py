"""Long paths: very many steps of several step sizes, and the errors of the Casimir functions after them."""

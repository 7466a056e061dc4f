"""Growth of the errors of the Casimir functions over very many steps, and the law of the states beside the uniform."""

"""Values of paths summed up and counted."""

"""Keys of dynamics in specs."""

"""What every model and scheme must satisfy, whatever its equations."""

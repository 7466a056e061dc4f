"""What a run says about dynamics."""

"""What a run says about spins."""

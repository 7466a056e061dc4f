"""From a spec to a results file."""

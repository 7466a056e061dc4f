"""What a paper about a scheme shows, of one system: five experiments and a report on them."""

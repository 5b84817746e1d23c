"""What lies between a receiver and a sample: beyond the paper, which leaves it out."""

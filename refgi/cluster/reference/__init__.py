"""What clustered visibility converges to: rays to the lights of a cluster or to its rectangle, the map projected back."""

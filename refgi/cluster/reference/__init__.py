"""What clustered visibility converges to: rays to the lights of a cluster or its rectangle, the map projected back."""

"""Clustered visibility."""

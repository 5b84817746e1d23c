"""What a camera sees, at falling resolutions (Sec. 4, hierarchical maps)."""

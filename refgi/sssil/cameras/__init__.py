"""Further cameras that see what the picture does not (Sec. 5, discussion)."""

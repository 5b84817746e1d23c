"""Light of earlier frames (Sec. 3.3), and sequences of frames that share it."""

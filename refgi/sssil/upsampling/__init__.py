"""From one level to the next finer one (Sec. 3.2, continuous combination)."""

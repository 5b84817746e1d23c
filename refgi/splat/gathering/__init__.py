"""Gathering around the projected point (Reflective Shadow Maps 2005): what splatting replaced, and its baseline."""

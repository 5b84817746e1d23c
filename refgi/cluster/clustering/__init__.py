"""Which lights share their visibility (Sec. 5): k-means, and the area light that stands for a cluster."""

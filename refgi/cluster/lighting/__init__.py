"""Light of every pixel light under the visibility of its area light (Sec. 4, 6), interleaved and blurred or not."""

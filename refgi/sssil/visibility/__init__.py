"""What the paper leaves out: whether anything stands between a receiver and a sample, by rays or by the depth map."""

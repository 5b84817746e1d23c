"""What breaks on a scene: promises of numerical stability, measured for each method, as rows of figure and limit."""

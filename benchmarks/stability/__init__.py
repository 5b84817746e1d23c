"""Attack every kernel, method, ray, file and process, and print a table of what is promised of each."""

"""One page in which results are explored: a map of the design points, and what is behind each."""

"""A page to explore results: a map of the design points, and the results of each."""

"""Studies of complex modes: what a worker solves, its rows, the tables, the full-order check."""

"""Studies of sensitivities: parameters asked for, what a worker solves, its rows, the tables."""

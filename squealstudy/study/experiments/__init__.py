"""Studies of the methods themselves, over a base study: accuracy against time, stability."""

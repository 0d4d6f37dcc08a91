"""Small models in batches: all design points at once, as arrays with one row a design point."""

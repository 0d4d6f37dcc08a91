"""Small models in batches: all design points at once, as arrays with a row for each."""

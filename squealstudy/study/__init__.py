"""Studies: definition, sampling, workers, store, tables, results."""

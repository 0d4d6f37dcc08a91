"""One run of a study: plan, structures, workers, store, cache, results."""

"""Parts of the benchmark of the ladder of reanalysis."""

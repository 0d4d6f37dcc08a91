"""Pictures of results, drawn from their tables without a model."""

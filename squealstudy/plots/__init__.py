"""Pictures from tables alone."""

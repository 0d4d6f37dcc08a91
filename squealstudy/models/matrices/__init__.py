"""Families of matrices: files, terms, coefficients as expressions."""

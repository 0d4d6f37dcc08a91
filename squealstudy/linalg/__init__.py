"""Sparse factorisation and the eigensolvers behind small interfaces."""

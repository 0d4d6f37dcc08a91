"""Assemblies of components and interfaces: what is modelled, before any reduction or analysis."""

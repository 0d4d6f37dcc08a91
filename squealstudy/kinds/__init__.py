"""Kinds of study, a folder each: section, columns, what is solved, tables."""

"""Friction curves of the package, one file each: the folder is read by itself."""

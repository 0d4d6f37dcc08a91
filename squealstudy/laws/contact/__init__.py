"""Contact laws of the package, one file each: the folder is read by itself."""

"""Regularisations of friction about zero sliding, one file each: the folder is read by itself."""

"""Complex modes of the unreduced equations: the reference of every reduced figure."""

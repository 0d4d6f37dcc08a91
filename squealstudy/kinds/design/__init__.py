"""Studies of design: what squeals over a matrix of operation, and the least change against it."""

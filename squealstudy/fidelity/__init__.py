"""Settings that meet a study's tolerance at least cost, tried on pilots."""

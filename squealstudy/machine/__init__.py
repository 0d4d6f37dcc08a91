"""All that depends on the machine; Linux, macOS and Windows differ here and nowhere else."""

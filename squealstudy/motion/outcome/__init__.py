"""What a run in time came to: growth, levels, energies, class."""

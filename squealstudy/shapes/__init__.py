"""Mode shapes on all nodes: what they are, pictures, a moving page, files for other programs."""

"""Mode shapes on all nodes: pictures, a moving page, names, files for other programs."""

"""From an assembly to small models: contact compliances, working points, component-mode bases."""

"""The hybrid model in time: contact layers as finite elements, the rest in modes."""

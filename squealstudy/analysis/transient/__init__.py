"""Modal systems with contact and friction, integrated in time."""

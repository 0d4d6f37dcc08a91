"""Lumped models from files: point masses and inertias on springs, dampers and contact."""

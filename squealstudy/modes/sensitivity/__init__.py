"""Derivatives of complex modes by parameters, each beside a finite change."""

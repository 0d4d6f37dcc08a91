"""Defaults that study files and the library share; nothing is imported for them."""

from __future__ import annotations

OF_FILE = "components"  # name of a model that a file describes, of meshes
LUMPED = "lumped"  # of masses and springs
DEFAULT_BAND = (1.0, 16000.0)  # Hz
BANDS = {"disc_brake": (500.0, 8000.0), OF_FILE: (500.0, 8000.0)}  # Hz, of models with their own
COMPONENT_CUTOFF_FACTOR, ASSEMBLY_CUTOFF_FACTOR = 1.5, 1.25  # of the top of the band
BASIS_TOLERANCE = 1e-4  # relative singular value of enrichment shapes
STABILITY_TOLERANCE = 1e-7  # a mode is unstable where its damping ratio is below minus this
MODE_TOLERANCE = 1e-4  # largest error of light or growing modes, relative
# of the basis of studies in time and of limit cycles. Enrichment shapes of smaller singular values
# are local contact shapes, in time modes far above the band, some of them unstable
# (studies/benchmarks/hybrid.py --flat)
TRANSIENT_BASIS = {
    "tolerance": 1e-3,
    "assembly_cutoff_factor": 1.5,
    "residual_responses": False,
}
CYCLE_TOLERANCE, CYCLE_REACH = 1e-2, 2.0  # of levels; contact velocity over the sliding speed
MAX_CYCLE_TOLERANCE, MAX_CYCLE_REACH = 0.1, 100.0
MAX_HARMONICS = 60  # of a limit cycle
FINITE_CHANGE, MAX_FINITE_CHANGE = 0.01, 0.5  # relative, predicted beside derivatives


def band_of(model: str) -> tuple[float, float]:
    """Band [Hz] of the modes of a model, where none is given."""
    return BANDS.get(model, DEFAULT_BAND)

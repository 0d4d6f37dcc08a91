"""Name the free motions of a singular stiffness by components, for its error message."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackError, eigsh

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.factor import SINGULAR
from squealstudy.models.assembly import Assembly
from squealstudy.models.component_slices import component_slices
from squealstudy.reduction.projected import AnyAssembly
from squealstudy.wording import listed, plural

FREE_MOTION = (
    "the static stiffness is singular: some motion is free; `squealstudy inspect` of a model file "
    "names it"
)
# eigenvalue of the stiffness, scaled to a diagonal of 1, below which a motion is free
MAX_FREE_EIGENVALUE = 1e-12
MAX_DENSE_FREEDOMS = 500  # most degrees of freedom for which all eigenvalues are computed
MAX_FREE_MOTIONS = 12  # eigenvalues computed in larger models: rigid motions of two components
FACTOR_SHIFT = 1e-9  # added to the scaled stiffness, which could not be factorised without
MIN_MOTION_SHARE = 0.1  # share in the free motions, over the largest share, from which it is named
MIN_RIGID_SHARE = 0.99  # a component is rigid if this share of its squared motion is rigid


def free_motion(assembly: AnyAssembly, K: sp.csr_matrix) -> ConvergenceError:
    """The error about a singular stiffness K (n_dof, n_dof), which names the free motions."""
    motions = ""
    if isinstance(assembly, Assembly) and any(len(c.coordinates) for c in assembly.components):
        motions = _free_motions_text(assembly, K)
    if not motions:
        return ConvergenceError(SINGULAR, FREE_MOTION)
    return ConvergenceError(
        SINGULAR,
        f"the static stiffness is singular: {motions}: a spring, a layer or a held set is missing, "
        "or has no stiffness here",
    )


def _free_motions_text(assembly: Assembly, K: sp.csr_matrix) -> str:
    """Text about the free motions; empty where none is found."""
    diagonal = np.abs(K.diagonal())
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, diagonal.max(initial=0.0) or 1.0))
    S = sp.csr_matrix(sp.diags(scale) @ K @ sp.diags(scale))
    n = S.shape[0]
    try:
        if n <= MAX_DENSE_FREEDOMS:
            values, vectors = la.eigh(S.toarray())
        else:
            values, vectors = eigsh(S, k=MAX_FREE_MOTIONS, sigma=-FACTOR_SHIFT, v0=np.ones(n))
    except (ArpackError, RuntimeError):
        return ""
    free = scale[:, None] * vectors[:, values < MAX_FREE_EIGENVALUE]
    if not free.shape[1]:
        return ""
    count_text = f"{plural(free.shape[1], 'motion')} {'is' if free.shape[1] == 1 else 'are'} free"
    if n > MAX_DENSE_FREEDOMS and free.shape[1] == MAX_FREE_MOTIONS:
        count_text = f"{MAX_FREE_MOTIONS} motions or more are free"
    return f"{count_text}, of {listed(_moving(assembly, free))}"


def _moving(assembly: Assembly, free: np.ndarray) -> list[str]:
    """Names of components and directions that take part in free motions (n_dof, k)."""
    from squealstudy.models.components.component_facts import MOTIONS, rigid_shapes

    spans, _ = component_slices(assembly.components)
    shares: dict[str, float] = {}
    for component in assembly.components:
        component_motion = free[spans[component.name]]
        u = component.at_nodes(component_motion) if len(component.coordinates) else component_motion
        squared_motion = float(np.sum(u**2))
        if not len(component.coordinates):
            shares[component.name] = squared_motion**0.5
            continue
        R = rigid_shapes(component.coordinates)
        size = np.linalg.norm(R, axis=0)
        R = R / np.where(size > 0, size, 1.0)  # turns of nodes in one place are none
        amounts = la.lstsq(R, u)[0]
        if np.sum((R @ amounts) ** 2) < MIN_RIGID_SHARE * squared_motion:
            shares[f"{component.name} in itself"] = squared_motion**0.5
            continue
        for motion, row in zip(MOTIONS, amounts, strict=True):
            shares[f"{component.name} {motion}"] = float(np.linalg.norm(row))
    largest = max(shares.values())
    return [name for name, share in shares.items() if share > MIN_MOTION_SHARE * largest]

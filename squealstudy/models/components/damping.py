"""Damping that a model file gives to a component: by its mass, its stiffness, its materials."""

from __future__ import annotations

from collections.abc import Mapping

import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.assembly import stiffness_matrix
from squealstudy.models.components.bodies import Body, changed_mesh, own_numbers
from squealstudy.models.components.file_matrices import symmetric
from squealstudy.models.components.model_file import BY_MATERIAL, KeyPath, Numbers, PlacedError


def damping_matrix(
    body: Body, numbers: Numbers, K: sp.csr_matrix, M: sp.csr_matrix
) -> sp.csr_matrix | None:
    """C of a file + alpha M + beta K + sum of beta_m K_m over materials, N s/m; None for none.

    Parameters
    ----------
    body : Body
    numbers : Numbers
    K, M : csr_matrix (n, n)
        Of its degrees of freedom, masses on it among them.

    Raises
    ------
    PlacedError
        A material that the component does not have.
    """
    keys: KeyPath = ("components", body.name)
    alpha, beta = (numbers.at(*keys, key) for key in ("mass_damping", "stiffness_damping"))
    parts = [factor * A for factor, A in ((alpha, M), (beta, K)) if factor]
    if body.matrices is not None and body.matrices[2] is not None:
        parts.append(body.matrices[2])
    table = numbers.file.components[body.name].material_damping
    by_material = {name: numbers.at(*keys, BY_MATERIAL, name) for name in table}
    if any(by_material.values()):
        parts += _of_materials(body, numbers.given, by_material)
    return symmetric(sum(parts)) if parts else None


def _of_materials(
    body: Body, given: Mapping[KeyPath, float], by_material: Mapping[str, float]
) -> list[sp.csr_matrix]:
    mesh = changed_mesh(body, own_numbers(body.name, given))
    found = []
    for name, beta in by_material.items():
        known = tuple(sorted(set(mesh.material)))
        if name not in known:
            listed = ", ".join(known)
            message = f"{body.name} has no material '{name}'; it has {listed}"
            raise PlacedError(("components", body.name, BY_MATERIAL, name), message, name, known)
        try:
            found.append(beta * body.expansion.restricted(stiffness_matrix(mesh, [name])))
        except ModelError as error:
            raise PlacedError(("components", body.name), str(error)) from error
    return found

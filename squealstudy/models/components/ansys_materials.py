"""Reads elastic materials of ANSYS archives from the commands MP and MPDATA."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from squealstudy.errors import ModelError
from squealstudy.models.components.ansys_commands import MODEL_FILE, STUDY, with_reason
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.materials import Elastic, Orthotropic, Unfinished
from squealstudy.models.fem.solid import Isotropic

ELASTIC = ("EX", "EY", "EZ", "PRXY", "PRXZ", "PRYZ", "NUXY", "NUXZ", "NUYZ", "GXY", "GXZ", "GYZ")
# constants that only an orthotropic material has
ORTHOTROPIC = frozenset(("EY", "EZ", "GXZ", "GYZ", "PRXZ", "PRYZ", "NUXZ", "NUYZ"))
# accepted relative difference of GXY from E / (2 (1 + nu)) of an isotropic material, as numbers in
# files are rounded
G_REL_TOLERANCE = 0.01
# properties that are passed over, and why
OTHER_PROPERTIES = {
    **with_reason("DMPR DMPS BETD ALPD DAMP", "damping is " + MODEL_FILE),
    **with_reason("MU", "friction is " + STUDY),
    **with_reason(
        "ALPX ALPY ALPZ CTEX CTEY CTEZ THSX THSY THSZ REFT KXX KYY KZZ C ENTH HF EMIS QRATE RSVX "
        "RSVY RSVZ MURX MURY MURZ PERX PERY PERZ LSST VISC SONC",
        "no property of an elastic body at one temperature",
    ),
}

Command = tuple[Line, list[str]]


def materials(
    single: Iterable[Command], tables: Iterable[Command]
) -> tuple[dict[str, Elastic | Unfinished], dict[str, tuple[Line, str]]]:
    """Read materials, by the names MAT1, MAT2, ...

    Materials without any elastic constant are left out: the model file may state them.

    Parameters
    ----------
    single, tables : iterable of (Line, words)
        Commands MP (a property at all temperatures), and MPDATA (at listed temperatures).

    Returns
    -------
    by_name : dict of str -> Elastic or Unfinished
    notes : dict of str -> (Line, str)
        Properties that are passed over: their first line, and why.

    Raises
    ------
    ModelError
        With file and line: a property that is unknown or missing, that differs between
        temperatures, or that contradicts another; values that no material can have.
    """
    rows = [(line, [*words, "", ""][:2], words[2:]) for line, words in single]
    rows += [(line, [*words, "", "", "", ""][2:4], words[5:]) for line, words in tables]
    values: dict[str, dict[str, tuple[float, Line]]] = {}
    notes: dict[str, tuple[Line, str]] = {}
    for line, (label, number), words in rows:
        label = label.upper()
        if label in OTHER_PROPERTIES:
            notes.setdefault(label, (line, OTHER_PROPERTIES[label]))
            continue
        if label != "DENS" and label not in ELASTIC:
            raise line.error(f"a property '{label}' of materials is not supported")
        numbers = [line.real(w, "a number") for w in words if w]
        if len(set(numbers)) != 1:
            raise line.error(f"expected {label} at one temperature, found {len(numbers)} values")
        name = f"MAT{line.whole(number, 'a material number')}"
        values.setdefault(name, {})[label] = (numbers[0], line)
    by_name = {
        name: _material(name, properties)
        for name, properties in values.items()
        if set(properties) - {"DENS"}
    }
    return by_name, notes


def _material(name: str, constants: Mapping[str, tuple[float, Line]]) -> Elastic | Unfinished:
    """The material with these constants; Unfinished if they lack a density."""
    _, line = next(iter(constants.values()))
    if constants.get("DENS", (0.0, line))[0] > 0:
        return _elastic(name, constants)
    moduli = _elastic(name, {**constants, "DENS": (1.0, line)})
    return Unfinished(moduli, None, str(line.error(f"{name} has no density DENS above zero")))


def _elastic(name: str, constants: Mapping[str, tuple[float, Line]]) -> Elastic:
    """An isotropic material, or an orthotropic one where the file has constants of several axes.

    ModelError where constants are missing or contradict each other.
    """
    numbers = {label: number for label, (number, _) in constants.items()}
    _, line = next(iter(constants.values()))
    for pair in ("XY", "XZ", "YZ"):
        if f"PR{pair}" in numbers and f"NU{pair}" in numbers:
            raise line.error(f"{name} has both PR{pair} and NU{pair}")
    try:
        if not set(numbers) & ORTHOTROPIC:
            E = numbers["EX"]
            nu = numbers.get("NUXY", numbers.get("PRXY"))
            G = numbers.get("GXY")
            nu = E / (2 * G) - 1 if nu is None and G is not None else nu
            if nu is None or not (E > 0 and -1 < nu < 0.5):
                raise line.error(f"{name}: expected EX > 0 and -1 < PRXY < 0.5")
            if G is not None and abs(G - E / (2 * (1 + nu))) > G_REL_TOLERANCE * G:
                raise line.error(
                    f"{name}: GXY is not that of an isotropic material of EX and PRXY: expected "
                    "moduli of all axes, or no GXY"
                )
            return Isotropic(E, nu, numbers["DENS"])
        E1, E2, E3 = (numbers[f"E{axis}"] for axis in "XYZ")
        ratios = {"XY": E1 / E2, "XZ": E1 / E3, "YZ": E2 / E3}  # PR / NU: PR is the major one
        nu12, nu13, nu23 = (
            numbers[f"NU{pair}"] * ratio if f"NU{pair}" in numbers else numbers[f"PR{pair}"]
            for pair, ratio in ratios.items()
        )
        shear = (numbers["GXY"], numbers["GXZ"], numbers["GYZ"])
        return Orthotropic.from_engineering(
            (E1, E2, E3), (nu12, nu13, nu23), shear, numbers["DENS"]
        )
    except KeyError as error:
        raise line.error(f"{name} has no {error.args[0]}") from None
    except (ZeroDivisionError, ModelError) as error:
        raise line.error(f"{name}: {error}") from error

"""The models that a study can name: those of this folder, and those of extensions."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from squealstudy.extensions import note_registered
from squealstudy.models.components.definition import NAME as OF_FILE
from squealstudy.models.lumped.definition import NAME as LUMPED
from squealstudy.models.matrices.family import NAME as MATRICES
from squealstudy.models.parameter import ModelDefinition

MODELS: dict[str, ModelDefinition] = {}


def register_model(model: ModelDefinition) -> None:
    """Add a model.

    Parameters
    ----------
    model : ModelDefinition

    Raises
    ------
    ValueError
        Another model has its name.
    """
    if model.name in (MATRICES, OF_FILE, LUMPED) or MODELS.get(model.name, model) != model:
        raise ValueError(f"there is a model '{model.name}' already")
    MODELS[model.name] = model
    note_registered(model.build.__module__, in_models=True)


def model_names() -> tuple[str, ...]:
    """Names of all models; the last three are models that files describe."""
    return (*MODELS, MATRICES, OF_FILE, LUMPED)


def _read_folder() -> None:
    for module_info in iter_modules(__path__):
        module = import_module(f"{__name__}.{module_info.name}")
        for member in vars(module).values():
            if isinstance(member, ModelDefinition):
                register_model(member)


_read_folder()

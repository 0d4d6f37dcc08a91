"""The models a study can name."""

from __future__ import annotations

from squealstudy.models.belt import BELT
from squealstudy.models.disc_brake import DISC_BRAKE
from squealstudy.models.hoffmann import HOFFMANN
from squealstudy.models.hulten import HULTEN
from squealstudy.models.matrix_family import NAME as MATRICES
from squealstudy.models.parameter import ModelDefinition

MODELS: dict[str, ModelDefinition] = {m.name: m for m in (DISC_BRAKE, HULTEN, HOFFMANN, BELT)}
MODEL_NAMES = (*MODELS, MATRICES)  # a family of matrices is what its study file makes of it

"""The models a study can name."""

from __future__ import annotations

from squealstudy.models.belt import BELT
from squealstudy.models.disc_brake import DISC_BRAKE
from squealstudy.models.hoffmann import HOFFMANN
from squealstudy.models.hulten import HULTEN
from squealstudy.models.parameter import ModelDefinition

MODELS: dict[str, ModelDefinition] = {m.name: m for m in (DISC_BRAKE, HULTEN, HOFFMANN, BELT)}

"""squealstudy: batch parametric studies of brake squeal.

The names are imported on first use: ``import squealstudy`` stays light.
"""

import sys

# `python -m squealstudy` looks for modules in the current directory first, which may be anybody's:
# remove it. docs/reference/trust.md lists what Python has imported by then. Programs of others
# (`python -m theirs.main`) that import this package keep the current directory.
if sys.argv[:1] == ["-m"] and not sys.flags.safe_path:
    _args = sys.orig_argv[1:]
    _modules = [_args[k + 1] for k, f in enumerate(_args[:-1]) if f[:1] + f[-1:] == "-m"]
    _modules += [arg[2:] for arg in _args if arg.startswith("-m")]
    if "squealstudy" in [m.split(".")[0] for m in _modules]:
        _current = sys.path.pop(0)
        if __path__[0][: -len("/squealstudy")] == _current:  # the package itself is there
            sys.path.append(_current)

from importlib import import_module
from typing import TYPE_CHECKING, Any

from squealstudy.version import __version__

if TYPE_CHECKING:
    from squealstudy.engine.pictures import register_plot
    from squealstudy.engine.results import Results
    from squealstudy.engine.template import new_study
    from squealstudy.face import Study, open_results, read_study, run
    from squealstudy.face_model import Model, list_models, model
    from squealstudy.mechanics.matrices import matrices
    from squealstudy.mechanics.system import System
    from squealstudy.study.examples import list_examples, write_example
    from squealstudy.tables.other_codes import other_codes

__all__ = [
    "Model",
    "Results",
    "Study",
    "System",
    "__version__",
    "list_examples",
    "list_models",
    "matrices",
    "model",
    "new_study",
    "open_results",
    "other_codes",
    "read_study",
    "register_plot",
    "run",
    "write_example",
]


FACE = "squealstudy.face"  # module of the names that ELSEWHERE does not have
ELSEWHERE = {
    **dict.fromkeys(("Model", "list_models", "model"), "squealstudy.face_model"),
    "Results": "squealstudy.engine.results",
    **dict.fromkeys(("list_examples", "write_example"), "squealstudy.study.examples"),
    "System": "squealstudy.mechanics.system",
    "matrices": "squealstudy.mechanics.matrices",
    "new_study": "squealstudy.engine.template",
    "other_codes": "squealstudy.tables.other_codes",
    "register_plot": "squealstudy.engine.pictures",
}


if not TYPE_CHECKING:  # a type checker refuses names that are not imported above

    def __getattr__(name: str) -> Any:
        """A name of `__all__`, imported now; AttributeError for others."""
        if name.startswith("_") or name not in __all__:
            from squealstudy.wording import did_you_mean

            hint = "" if name.startswith("_") else did_you_mean(name, __all__)
            raise AttributeError(f"module 'squealstudy' has no attribute '{name}'{hint}")
        return getattr(import_module(ELSEWHERE.get(name, FACE)), name)


def __dir__() -> list[str]:
    """The public names."""
    return __all__

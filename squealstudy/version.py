"""The version of the package, and where its files are."""

from pathlib import Path

__version__ = "0.3.0"
PACKAGE_FOLDER = Path(__file__).parent

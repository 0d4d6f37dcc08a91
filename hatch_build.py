"""The README as package indices show it: without the clone that its links and picture lead into."""

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

LINK = re.compile(r"\[([^\]]*)\]\((?!\w+://|#)([^)\s]+)\)")
PICTURE = re.compile(
    r"^!\[[^\]]*\]\([^)]*\)\n\n.*?\n\n", re.MULTILINE | re.DOTALL
)  # and its caption
OF_THE_CLONE = re.compile(
    r"^Install and pass the tests:\n\n```.*?```\n\n", re.MULTILINE | re.DOTALL
)
SHIPPED = re.compile(r"([\w./]*squealstudy) run studies/(\w+)\.toml")  # now by name
ENDS = "\nPages named here are in the source distribution.\n"


def for_an_index(readme: str, address: str = "") -> str:
    """The README with links that lead somewhere.

    Parameters
    ----------
    readme : str
    address : str
        Of the files of this version in the web; without one, links into the clone become plain
        names, and the picture is left out.
    """
    text = OF_THE_CLONE.sub("", readme).replace("pip install -e .", "pip install squealstudy")
    text = SHIPPED.sub(r"\1 examples \2 && \1 run \2.toml", text)
    text = text.replace('read_study("studies/', 'read_study("')
    if address:
        return LINK.sub(rf"[\1]({address.rstrip('/')}/\2)", text)
    return LINK.sub(_named, PICTURE.sub("", text)) + ENDS


def _named(link: re.Match[str]) -> str:
    """Words of a link, and of a page its name."""
    text, path = link.groups()
    page = path.partition("#")[0]
    return f"`{text}`" if text == page else f"{text} (`{page}`)"


class ReadmeHook(MetadataHookInterface):
    """Called by hatchling; `address` is a setting in pyproject.toml."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the long description."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        shown = for_an_index(text, self.config.get("address", ""))
        metadata["readme"] = {"content-type": "text/markdown", "text": shown}

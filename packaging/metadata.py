"""Metadata that depend on the project's address: what the package index shows of README.md, and the links beside it.

A package index knows no relative links. With `repository-code` in CITATION.cff they point to that address, at the
tag of this version; without it they become plain text and the picture is left out, so that none is broken.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

PICTURE = re.compile(r"!\[([^\]]*)\]\((?!https?:)([^)]+)\)")
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!https?:|#)([^)]+)\)")


def repository(citation: str) -> str | None:
    """Address that CITATION.cff states, None if it states none."""
    found = re.search(r"^repository-code:\s*[\"']?(https://[^\s\"']+)", citation, re.MULTILINE)
    return found[1].rstrip("/") if found else None


def absolute_links(text: str, address: str | None, tag: str) -> str:
    """Markdown whose relative links and pictures work outside the repository."""
    if address is None:
        return LINK.sub(r"\1", re.sub(rf"{PICTURE.pattern}\n*", "", text))
    text = PICTURE.sub(rf"![\1]({address}/raw/{tag}/\2)", text)
    return LINK.sub(rf"[\1]({address}/blob/{tag}/\2)", text)


class Metadata(MetadataHookInterface):
    """Fills `readme` and `urls`."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Read README.md and CITATION.cff, and set both fields."""
        root = Path(self.root)
        address = repository((root / "CITATION.cff").read_text(encoding="utf-8"))
        tag = f"v{metadata['version']}"
        text = absolute_links((root / "README.md").read_text(encoding="utf-8"), address, tag)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
        metadata["urls"] = (
            {}
            if address is None
            else {
                "Source": address,
                "Issues": f"{address}/issues",
                "Changelog": f"{address}/blob/{tag}/CHANGELOG.md",
                "Documentation": f"{address}/blob/{tag}/docs/index.md",
            }
        )

"""Metadata that depend on the project's address: what the package index shows of README.md, and the links beside it.

The address is `Source` of `project.urls` in pyproject.toml, and nowhere else. A package index knows no relative links:
they point to that address, at the tag of this version. While the address is a placeholder they become plain text, the
picture is left out and no link is built on it, so that none is broken.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

PICTURE = re.compile(r"!\[([^\]]*)\]\((?!https?:)([^)]+)\)")
#: A domain that can never exist (RFC 2606): the address is not known.
PLACEHOLDER = ".invalid"
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!https?:|#)([^)]+)\)")


def repository(urls: dict[str, str]) -> str | None:
    """The project's address, None while pyproject.toml has a placeholder in its place."""
    address = urls.get("Source", "").rstrip("/")
    return address if address and PLACEHOLDER not in address else None


def cited(citation: str) -> str | None:
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
        """Read README.md, and set both fields."""
        urls = metadata["urls"]
        address = repository(urls)
        tag = f"v{metadata['version']}"
        text = absolute_links((Path(self.root) / "README.md").read_text(encoding="utf-8"), address, tag)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
        if address is None:
            urls.pop("Source", None)
            return
        urls |= {
            "Source": address,
            "Issues": f"{address}/issues",
            "Changelog": f"{address}/blob/{tag}/CHANGELOG.md",
            "Documentation": f"{address}/blob/{tag}/docs/index.md",
        }

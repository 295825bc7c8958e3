"""A hook of the documentation: the notebooks of examples/ as pages, and the list of the example programs."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

EXAMPLES = Path(__file__).parents[1] / "examples"


def on_files(files: Files, config: Any) -> Files:
    """Add a page for each notebook."""
    for path in sorted(EXAMPLES.glob("notebooks/*.ipynb")):
        stored = json.loads(path.read_text(encoding="utf-8"))
        text = "\n\n".join(block for cell in stored["cells"] for block in blocks(cell))
        text += f"\n\nThis page is the notebook `examples/notebooks/{path.name}` with its outputs.\n"
        files.append(File.generated(config, f"examples/{path.stem}.md", content=text))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """Put the table of examples/README.md into its page."""
    rows = re.findall(r"^\|.*$", (EXAMPLES / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    return markdown.replace("<!-- examples -->", "\n".join(rows))


def blocks(cell: dict[str, Any]) -> Iterator[str]:
    """Markdown of a cell and of its outputs."""
    source = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        yield source
        return
    yield f"```python\n{source}\n```"
    for output in cell["outputs"]:
        if output["output_type"] == "stream":
            yield f"```text\n{''.join(output['text']).rstrip()}\n```"
        else:
            image = output["data"]["image/png"]
            yield f'<p class="figure"><img alt="Figure of the cell above" src="data:image/png;base64,{image}"></p>'

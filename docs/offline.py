"""A hook of the documentation: the search of pages that are opened from a folder, without a request to the network.

A browser starts no worker from a file of the disk. The theme's remedy is a script that it fetches from a CDN; here the
source of the theme's own worker is written into a script of the site, which starts it from memory.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

SCRIPT = "assets/javascripts/search_worker.js"
PROGRAM = """if (location.protocol === "file:") {{
  const source = {source};
  window.Worker = class extends Worker {{
    constructor() {{
      super(URL.createObjectURL(new Blob([source], {{ type: "text/javascript" }})));
    }}
  }};
}}
"""


def on_config(config: Any) -> Any:
    """Take the place of the script that the plugin `offline` would fetch."""
    config.extra["polyfills"] = [SCRIPT]
    return config


def on_post_build(config: Any) -> None:
    """Write the script from the worker that the theme has put into the site."""
    site = Path(config.site_dir)
    (worker,) = site.glob("assets/javascripts/workers/search.*.min.js")
    source = json.dumps(worker.read_text(encoding="utf-8"))
    (site / SCRIPT).write_text(PROGRAM.format(source=source), encoding="utf-8")

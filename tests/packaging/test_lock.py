"""The locked packages of a user's installation: the pins of constraints.txt, each file with its checksum."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def pins(text: str) -> dict[str, tuple[str, str]]:
    """Version, and the rest of the line with the lines that go on, by name."""
    found = re.findall(r"^([A-Za-z0-9._-]+)==([^\s;]+)((?:.*\\\n)*.*)$", text, re.MULTILINE)
    return {plain(name): (version, rest) for name, version, rest in found}


LOCKED = pins((ROOT / "requirements.lock").read_text(encoding="utf-8"))
PINNED = pins((ROOT / "constraints.txt").read_text(encoding="utf-8"))


def test_every_locked_package_has_the_pinned_version_and_checksums():
    assert {name: version for name, (version, _) in LOCKED.items() if name in PINNED} == {
        name: PINNED[name][0] for name in LOCKED if name in PINNED
    }
    assert all(re.search(r"--hash=sha256:[0-9a-f]{64}", rest) for _, rest in LOCKED.values())


def test_what_the_project_names_is_locked():
    optional = PROJECT["optional-dependencies"]
    named = [
        *PROJECT["dependencies"],
        *(one for extra in optional if extra not in ("dev", "bundles", "cloud", "api") for one in optional[extra]),
    ]
    names = {plain(match[0]) for one in named if (match := re.match(r"[A-Za-z0-9._-]+", one))} - {"gyronorth"}
    assert names <= set(LOCKED)

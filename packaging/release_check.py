"""What must hold before a release, as a command: `make release-check`.

python packaging/release_check.py [STEP ...]    all steps, or those named; exit code 1 if any failed

Wheels and sdist are built from the committed files only, into out/release. Tests are not run here: `bash .ci/run`,
`make long` and `make oldest` do.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

from metadata import cited, repository

ROOT = Path(__file__).parents[1]
OUT = ROOT / "out" / "release"
DIST = OUT / "dist"
#: What pip adds to a fresh environment with the wheel and all it depends on, compiled as pip leaves it, MB.
SIZE_LIMIT = 250
#: Size of the core's wheel, MB.
WHEEL_LIMIT = 1.5
DEMO = ["heading", str(ROOT / "examples/data/demo.npz"), "--sensor", "sdc500"]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
VERSION = PROJECT["version"]


def run(*command: str | Path, **extra: object) -> str:
    """Output of a command; whatever it printed is the message if it fails. It does not see this tree's modules."""
    environment = apart() | {name: str(value) for name, value in extra.items()}
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, env=environment, cwd=OUT)
    if done.returncode:
        raise AssertionError(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def versions() -> str:
    """One version in pyproject.toml, CITATION.cff, the bundles, the recipe and the newest heading of the changelog."""
    stated = {
        "CITATION.cff": re.search(r"^version: (.+)$", text("CITATION.cff"), re.MULTILINE),
        "packaging/bundles": re.search(r'^version = "(.+)"$', text("packaging/bundles/pyproject.toml"), re.MULTILINE),
        "conda recipe": re.search(r'set version = "(.+?)"', text("packaging/conda/meta.yaml")),
    }
    wrong = {name: found[1] if found else None for name, found in stated.items() if not found or found[1] != VERSION}
    assert not wrong, f"pyproject.toml says {VERSION}, but {wrong}"
    newest = re.search(r"^## (.+)$", text("CHANGELOG.md"), re.MULTILINE)
    dated = newest and re.fullmatch(rf"\[?{re.escape(VERSION)}\]? - (\d{{4}}-\d\d-\d\d)", newest[1])
    assert dated, f"CHANGELOG.md begins with `{newest and newest[1]}`; a release needs `{VERSION} - ` and its date"
    return f"{VERSION}, {dated[1]}"


def address() -> str:
    """The address is known: `Source` of pyproject.toml is no placeholder, CITATION.cff states the same."""
    where = repository(PROJECT["urls"])
    placeholder = PROJECT["urls"].get("Source")
    assert where, f"pyproject.toml: the address is a placeholder ({placeholder}). State it as Source in [project.urls]"
    stated = cited(text("CITATION.cff"))
    assert stated == where, f"CITATION.cff says {stated}. State `repository-code: {where}`, as pyproject.toml does"
    return where


def commit() -> str:
    """Whether the files are those of the commit, and the commit has the tag of this version."""
    changed = run("git", "-C", ROOT, "status", "--porcelain").strip()
    assert not changed, f"not committed:\n{changed}"
    tags = run("git", "-C", ROOT, "tag", "--points-at", "HEAD").split()
    return f"v{VERSION}" if f"v{VERSION}" in tags else f"clean; not yet tagged v{VERSION}"


def build() -> str:
    """Wheels and sdist of the commit, built twice from two folders: the same bytes."""
    head, epoch = run("git", "-C", ROOT, "log", "-1", "--format=%H %ct").split()
    sums = []
    for number in (1, 2):
        source, dist = OUT / f"source{number}", OUT / f"dist{number}"
        for folder in (source, dist):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
        run("bash", "-c", f"git -C '{ROOT}' archive {head} | tar -x -C '{source}'")
        command = (sys.executable, "-m", "build", "--no-isolation", "--outdir", dist)
        run(*command, source, SOURCE_DATE_EPOCH=epoch)
        run(*command, "--wheel", source / "packaging" / "bundles", SOURCE_DATE_EPOCH=epoch)
        sums.append({path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(dist.iterdir())})
    assert sums[0] == sums[1], f"two builds differ: {sums}"
    shutil.rmtree(DIST, ignore_errors=True)
    (OUT / "dist1").rename(DIST)
    (DIST / "SHA256SUMS").write_text("".join(f"{value}  {name}\n" for name, value in sums[0].items()))
    size = wheel().stat().st_size / 1e6
    assert size < WHEEL_LIMIT, f"the wheel has {size:.2f} MB, limit {WHEEL_LIMIT}"
    return f"{', '.join(sums[0])}; wheel {size:.2f} MB; SOURCE_DATE_EPOCH={epoch}"


def check() -> str:
    """`twine check --strict`, check-wheel-contents, and no relative link in the long description."""
    built = sorted(DIST.glob("gyronorth*"))
    assert built, "nothing is built; run the step build first"
    run(sys.executable, "-m", "twine", "check", "--strict", *built)
    run(tool("check-wheel-contents"), wheel())
    run(tool("check-wheel-contents"), "--toplevel", "gyronorth_bundles", bundles())
    described = run("unzip", "-p", wheel(), f"gyronorth-{VERSION}.dist-info/METADATA")
    relative = re.findall(r"\]\((?!https?:|#)[^)]*\)", described)
    assert not relative, f"links that an index cannot follow: {relative}"
    return "twine, check-wheel-contents, links"


def pythons() -> str:
    """The wheel alone in a fresh environment of each Python of the classifiers: the demo's heading."""
    said = []
    for name in classified():
        python = interpreter(name)
        assert python, f"the classifiers name Python {name}, which is not installed here"
        environment = OUT / f"venv{name}"
        shutil.rmtree(environment, ignore_errors=True)
        run(python, "-m", "venv", environment)
        before = megabytes(environment)
        pip = (environment / "bin" / "python", "-m", "pip", "install", "-q", "--disable-pip-version-check")
        run(*pip, *(("-c", ROOT / "constraints.txt") if name == "3.11" else ()), wheel())
        answer = run(environment / "bin" / "gyronorth", *DEMO)
        assert re.search(r"^heading +45\.7", answer, re.MULTILINE), answer
        size = megabytes(environment) - before
        assert size < SIZE_LIMIT, f"{size} MB with Python {name}, limit {SIZE_LIMIT}"
        said.append(f"{name}: {size} MB beside {before} MB of pip")
    return ", ".join(said)


def cures() -> str:
    """What the small installation leaves out is said with its cure, and the cure works."""
    environment = OUT / "venv3.11"
    gyronorth = environment / "bin" / "gyronorth"
    assert gyronorth.exists(), "nothing is installed; run the step pythons first"
    report = (gyronorth, *DEMO, "--report", OUT / "demo.html")
    paper = (gyronorth, *DEMO, "--method", "paper", "--window", "0:100")
    for command, extra in ((report, "gyronorth[report]"), (paper, "gyronorth[bundles,learned]")):
        done = subprocess.run([*map(str, command)], capture_output=True, text=True, env=apart(), cwd=OUT)
        assert done.returncode == 2, f"{command} ended with {done.returncode}: {done.stderr}"
        assert f"pip install '{extra}'" in done.stderr, f"{command}: {done.stderr}"
    pip = (environment / "bin" / "python", "-m", "pip", "install", "-q", "--disable-pip-version-check")
    found = ("-c", ROOT / "constraints.txt", "--find-links", DIST)
    run(*pip, *found, f"gyronorth[report,bundles,learned] @ {wheel().as_uri()}")
    run(*report)
    answer = run(*paper)
    assert "bundle             paper" in answer, answer
    return "report; bundles,learned"


def extras() -> str:
    """Every extra resolves from the pins, with the built wheels."""
    environment = OUT / "venv3.11"
    pip = (environment / "bin" / "python", "-m", "pip", "install", "-q", "--dry-run", "--disable-pip-version-check")
    names = list(PROJECT["optional-dependencies"])
    for name in names:
        run(*pip, "-c", ROOT / "constraints.txt", "--find-links", DIST, f"gyronorth[{name}] @ {wheel().as_uri()}")
    return ", ".join(names)


def apart() -> dict[str, str]:
    """This process's environment without what points Python to this tree."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}


def text(name: str) -> str:
    """A file of the repository."""
    return (ROOT / name).read_text(encoding="utf-8")


def megabytes(folder: Path) -> int:
    """What a folder takes on the disk."""
    return int(run("du", "-sm", folder).split()[0])


def wheel() -> Path:
    """The core's wheel."""
    return built_wheel("gyronorth")


def bundles() -> Path:
    """The wheel of the trained bundles."""
    return built_wheel("gyronorth_bundles")


def built_wheel(name: str) -> Path:
    """A wheel that the step `build` made."""
    found = next(DIST.glob(f"{name}-*.whl"), None)
    assert found, "nothing is built; run the step build first"
    return found


def tool(name: str) -> Path:
    """A command of the environment that runs this."""
    return Path(sys.executable).parent / name


def classified() -> list[str]:
    """Versions of Python that the classifiers name."""
    found = (re.search(r"Python :: (3\.\d+)$", classifier) for classifier in PROJECT["classifiers"])
    return [match[1] for match in found if match]


def interpreter(name: str) -> str | None:
    """A Python of that version: of pyenv, or on the path."""
    pyenv = sorted(Path.home().glob(f".pyenv/versions/{name}.*/bin/python"))
    return str(pyenv[-1]) if pyenv else shutil.which(f"python{name}")


STEPS: dict[str, Callable[[], str]] = {
    step.__name__: step for step in (versions, address, commit, build, check, pythons, cures, extras)
}


def main(names: list[str]) -> int:
    """Run the steps in order; a later one uses what an earlier one built."""
    unknown = [name for name in names if name not in STEPS]
    if unknown:
        asked = {"-h", "--help"}.intersection(unknown)
        print(__doc__ if asked else f"No step {', '.join(unknown)}.", f"Steps: {', '.join(STEPS)}", sep="\n")
        return 0 if asked else 2
    OUT.mkdir(parents=True, exist_ok=True)
    failed = False
    for name in names or STEPS:
        try:
            print(f"ok      {name}: {STEPS[name]()}", flush=True)
        except AssertionError as error:
            failed = True
            print(f"FAILED  {name}: {error}", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

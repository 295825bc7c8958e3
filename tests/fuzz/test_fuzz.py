"""Mutated inputs of every kind end in one message, a reason or a finite answer; found ones stay in the corpus."""

from collections import Counter
from pathlib import Path

import pytest
from fuzz.running import broken, campaign
from fuzz.targets import targets

CORPUS = Path(__file__).with_name("corpus")


@pytest.mark.slow
@pytest.mark.parametrize("cases", [500, pytest.param(20_000, marks=pytest.mark.long)])
def test_no_input_breaks_the_oracle(cases, tmp_path):
    counts, failures = campaign(cases, 1, tmp_path)
    assert not failures, "\n".join(failures)
    assert counts["refused"] > cases / 4
    assert counts["valid"] > 0


@pytest.mark.slow
def test_what_was_found_stays_cured(tmp_path):
    by_name = {target.name: target for target in targets(tmp_path)}
    for path in sorted(CORPUS.iterdir()):
        target = by_name.get(path.name.partition(".")[0])
        if target is not None:
            assert broken(target, path.read_bytes(), Counter()) is None, path.name

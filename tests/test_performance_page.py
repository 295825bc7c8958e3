"""The page of costs is what its measurements give."""

from __future__ import annotations

from benchmarks import page


def test_the_page_is_written_from_its_data():
    assert (page.PAGES / "performance.md").read_text(encoding="utf-8") == page.page()


def test_a_ratio_is_ours_over_theirs_of_the_same_round():
    one = {
        "title": "work",
        "ours": "us",
        "promised": {"them": 0.5},
        "cpu_s": {"us": [3.0, 8.0, 4.0], "them": [2.0, 4.0, 4.0]},
    }
    assert page.ratios([one]).splitlines()[-1] == "| work | them | 1.50 (1.00 to 2.00) | 3 | 2.00 |"


def test_stages_stand_in_their_order_and_add_up():
    found = [
        {"format": "csv", "program": "ours", "cpu_s": {"start": 0.5, "reading": 1.25}},
        {"format": "csv", "program": "theirs", "cpu_s": {"start": 0.5, "loading": 0.25}},
    ]
    assert page.stages(found).splitlines() == [
        "| stage, CPU-s | csv, ours | csv, theirs |",
        "|---|---|---|",
        "| start | 0.50 | 0.50 |",
        "| reading | 1.25 |  |",
        "| loading |  | 0.25 |",
        "| together | 1.75 | 0.75 |",
    ]

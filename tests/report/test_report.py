"""Report: text, tables, NMEA sentences, figures and the HTML page of hand-made estimates."""

from __future__ import annotations

import csv
import io
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from math import degrees, radians

import numpy as np
import pytest
from pynmeagps import NMEAReader

from gyronorth.allan import allan_deviation
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.catalogue import NMEA_SETS
from gyronorth.errors import InputError
from gyronorth.estimate import Convergence, DisturbanceFound, HeadingDensity, HeadingEstimate, Pose, Turn
from gyronorth.findings import Finding
from gyronorth.many.table import STAMPS, write_table
from gyronorth.report import figures, nmea, tables, terminal, wording
from gyronorth.report.html import heading_page
from gyronorth.report.tables import Outcome

VALID = HeadingEstimate(
    heading=radians(40.31),
    sigma=radians(4.58),
    interval95=(radians(31.3), radians(49.3)),
    reasons=(),
    warnings=(),
    method="mean",
    method_reason="one pose, undisturbed",
    bundle=None,
    roll=radians(0.02),
    pitch=radians(-0.01),
    latitude=radians(32.11),
    sensor="sdc500",
    duration=100.0,
    rate_hz=600.0,
    end_time_utc=None,
    poses=(Pose(0.0, 100.0, radians(40.31)),),
    turns=(),
    sigma_parts={"noise": radians(0.54), "drift": radians(0.9), "turn_on_bias": radians(4.4), "levelling": 0.0},
    sensor_errors=None,
    rate_mean=(9.7 * DEG_PER_HOUR, -8.2 * DEG_PER_HOUR, -8.0 * DEG_PER_HOUR),
    rate_norm=15.03 * DEG_PER_HOUR,
    implied_latitude=radians(32.0),
)
RATE_NORM = Finding("rate_norm", "The mean rate is 199.00 deg/h off Earth rate; at most 4.10 deg/h fits.", 199.0, 4.1)
REFUSED = replace(VALID, reasons=(RATE_NORM,), heading=radians(358.96), interval95=(radians(350), radians(8)))
UNKNOWN = replace(REFUSED, heading=None, sigma=None, interval95=(0.0, 2 * np.pi), implied_latitude=None, roll=None)
CONVERGENCE = Convergence(
    time=np.array([5.0, 10.0, 50.0, 100.0]),
    heading=np.radians([20.0, 60.0, 45.0, 40.31]),
    half_width=np.radians([180.0, 60.0, 20.0, 9.0]),
    valid=np.array([False, False, True, True]),
)


def checksum(sentence: str) -> int:
    """Exclusive or between $ and *, by another route than the package's."""
    total = 0
    for character in sentence[1 : sentence.index("*")]:
        total ^= ord(character)
    return total


class TestWording:
    @pytest.mark.parametrize(
        ("degrees", "text"), [(0, "0.00"), (359.994, "359.99"), (359.996, "0.00"), (-0.001, "0.00"), (725.5, "5.50")]
    )
    def test_heading_never_reads_360(self, degrees, text):
        assert wording.heading_text(degrees) == text

    def test_interval(self):
        assert wording.interval_text([31.3, 49.3]) == "31.30 to 49.30 deg"
        assert wording.interval_text([350.0, 8.0]) == "350.00 to 8.00 deg, through north"
        assert wording.interval_text([0.0, 360.0]) == "any heading"

    @pytest.mark.parametrize(
        ("value", "text"),
        [(None, "unknown"), (4.5812, "4.58"), (0.00034, "0.00034"), (-0.001, "-0.001"), (0.0, "0.00")],
    )
    def test_numbers_keep_two_figures(self, value, text):
        assert wording.number_text(value) == text


class TestNmea:
    def test_valid_heading_is_read_back(self):
        ths, hdt, status = nmea.sentences(VALID)
        message = NMEAReader.parse(hdt)
        assert (message.talker, message.msgID, message.headingT, message.headingTu) == ("HE", "HDT", 40.3, "T")
        assert hdt == "$HEHDT,040.3,T*28\r\n"  # checksum computed by hand
        assert NMEAReader.parse(status).payload == ["A", "040.3", "4.58", "031.3", "049.3", "mean", "0", ""]
        assert (NMEAReader.parse(ths).headt, NMEAReader.parse(ths).mi) == (40.3, "A")

    def test_decimals_follow_sigma(self):
        _, hdt, status = nmea.sentences(replace(VALID, sigma=radians(0.05)))
        assert hdt.startswith("$HEHDT,040.31,T*")
        assert NMEAReader.parse(status).payload[1] == "040.31"

    def test_refused_heading_leaves_no_number_in_hdt(self):
        ths, status = nmea.sentences(REFUSED)
        assert (NMEAReader.parse(ths).identity, NMEAReader.parse(ths).headt, NMEAReader.parse(ths).mi) == (
            "HETHS",
            "",
            "V",
        )
        assert NMEAReader.parse(status).payload == ["V", "359.0", "4.58", "350.0", "008.0", "mean", "1", "rate_norm"]

    def test_unknown_heading(self):
        ths, status = nmea.sentences(UNKNOWN)
        assert NMEAReader.parse(ths).headt == ""
        assert NMEAReader.parse(status).payload[:5] == ["V", "", "", "000.0", "360.0"]

    def test_heading_that_rounds_to_north(self):
        _, hdt, _ = nmea.sentences(replace(VALID, heading=radians(359.96)))
        assert hdt.startswith("$HEHDT,000.0,T*")

    def test_longest_sentence_and_checksum(self):
        codes = ["rate_norm", "implied_latitude", "motion", "too_short", "too_noisy", "near_pole", "saturated"]
        refused = replace(REFUSED, reasons=tuple(Finding(code, "") for code in codes), method="inertial")
        for sentence in nmea.sentences(refused):
            assert len(sentence) <= 82  # IEC 61162-1
            assert sentence.endswith("\r\n")
            assert int(sentence[sentence.index("*") + 1 : -2], 16) == checksum(sentence)
        payload = NMEAReader.parse(nmea.sentences(refused)[1]).payload
        assert payload[6] == "7"
        assert payload[7] == "rate_norm;implied_latitude;motion"  # the count tells that more did not fit

    @pytest.mark.parametrize("kind", list(NMEA_SETS))
    @pytest.mark.parametrize("mode", ["A", "E", "S"])
    def test_a_set_is_read_back_by_another_program(self, kind, mode):
        turned = replace(VALID, roll=radians(1.25), pitch=radians(-3.5))
        lines = nmea.running_sentences(turned, kind=kind, mode=mode, rate_of_turn=radians(-0.5))
        parsed = {NMEAReader.parse(line).identity: NMEAReader.parse(line) for line in lines}
        assert all(int(line[line.index("*") + 1 : -2], 16) == checksum(line) for line in lines)
        if kind in ("standard", "ths"):
            assert (parsed["HETHS"].headt, parsed["HETHS"].mi) == (40.3, mode)
        assert ("HEHDT" in parsed) is (kind != "ths" and mode != "S")  # a replay is no compass
        if kind == "octans":
            tilt = ["PHTRO,3.50,P,1.25,T", "PHTRH,3.50,P,1.25,T,,"] if mode != "S" else []
            word = "PHINF,00000008" if mode != "S" else "PHINF,0000000F"
            assert [line[1:].partition("*")[0] for line in lines if line.startswith("$PH")] == [*tilt, word]
        else:
            assert (parsed["HEROT"].rot, parsed["HEROT"].valid) == ((-30.0, "A") if mode != "S" else ("", "V"))

    @pytest.mark.parametrize("degrees_a_minute", [0.0, -0.0, -0.04, -1e-12])
    def test_no_turn_has_no_sign(self, degrees_a_minute):
        lines = nmea.running_sentences(VALID, kind="ths", mode="A", rate_of_turn=radians(degrees_a_minute / 60))
        assert lines[1].startswith("$HEROT,0.0,A*")

    @pytest.mark.parametrize("kind", list(NMEA_SETS))
    @pytest.mark.parametrize("estimate", [None, REFUSED, UNKNOWN])
    def test_no_set_gives_an_invalid_heading(self, kind, estimate):
        lines = nmea.running_sentences(estimate, kind=kind, mode="A", rate_of_turn=None)
        text = "".join(lines)
        assert "HDT" not in text
        assert "$HETHS,,V*14\r\n" in text or kind in ("hdt", "octans")
        assert "PHINF,0000000" not in text or int(text.partition("PHINF,")[2][:8], 16) & 1


class TestTables:
    def test_csv_row_of_each_kind(self, tmp_path):
        outcomes = [
            Outcome("good, of 1.csv", VALID, heading_true=radians(43)),
            Outcome("bad.csv", REFUSED),
            Outcome("broken.csv", message='Row 3 of broken.csv: "x" is not a number.'),
        ]
        write_table(tmp_path / "out.csv", "{}", outcomes)
        good, bad, broken = csv.DictReader((tmp_path / "out.csv").read_text().splitlines())
        assert tuple(good) == (*tables.COLUMNS, *STAMPS)
        assert (good["file"], good["valid"], good["reasons"]) == ("good, of 1.csv", "true", "")
        assert float(good["heading_deg"]) == pytest.approx(40.31)
        assert float(good["error_deg"]) == pytest.approx(-2.69)
        assert (bad["valid"], bad["reasons"], bad["heading_true_deg"]) == ("false", "rate_norm", "")
        assert (broken["heading_deg"], broken["message"]) == ("", outcomes[2].message)

    def test_json_documents(self):
        assert Outcome("a", VALID).document() == {"file": "a", "error": None, **VALID.to_json()}
        assert Outcome("a", message="x").document() == {"file": "a", "error": "x", "heading_deg": None, "valid": False}

    def test_failed_write_leaves_what_stood_there(self, tmp_path, monkeypatch):
        path = tmp_path / "out.csv"
        path.write_text("before")

        class Full:
            """A writer of rows to a full disk."""

            def writerow(self, _):
                raise OSError(28, "No space left on device")

        monkeypatch.setattr(csv, "writer", lambda *_, **__: Full())
        with pytest.raises(InputError, match=r"out\.csv cannot be written: No space left"):
            write_table(path, "{}", [Outcome("a", VALID)])
        assert path.read_text() == "before"
        assert [entry.name for entry in tmp_path.iterdir()] == ["out.csv"]


class TestTerminal:
    def test_piped_text_is_plain(self):
        stream = io.StringIO()
        terminal.print_heading(Outcome("rec.csv", REFUSED, heading_true=radians(43)), stream)
        text = stream.getvalue()
        assert text.isascii()  # no colour, no box
        lines = dict(re.split(r"  +", line, maxsplit=1) for line in text.splitlines())
        assert lines["verdict"] == "refused: do not use this heading"
        assert lines["heading"] == "358.96 deg (refused)"
        assert lines["reason"] == f"rate_norm: {RATE_NORM.message}"
        assert lines["reference heading"] == "43.00 deg, error -44.04 deg"

    def test_panel_on_a_terminal(self):
        class Screen(io.StringIO):
            def isatty(self):
                return True

        screen = Screen()
        terminal.print_heading(Outcome("rec [bold].csv", VALID), screen)
        assert "true north" in screen.getvalue()
        assert "rec [bold].csv" in screen.getvalue()  # a file name is no markup

    def test_no_heading(self):
        assert wording.heading_lines(Outcome("rec.csv", UNKNOWN))[:4] == [
            ("verdict", "refused: no heading could be computed"),
            ("heading", "none"),
            ("sigma", "unknown"),
            ("95 % interval", "any heading"),
        ]

    def test_folder_table(self):
        stream = io.StringIO()
        terminal.print_folder(
            [Outcome("a.csv", VALID), Outcome("b.csv", REFUSED), Outcome("c.csv", message="Bad.")], stream
        )
        header, a, b, c, note = stream.getvalue().splitlines()
        assert header.split()[0] == "file"
        assert a.split() == ["a.csv", "40.31", "4.58", "31.30", "to", "49.30", "valid"]
        assert b.endswith("refused (rate_norm)")
        assert c.split() == ["c.csv", "error", "[1]"]
        assert note == "[1] error: Bad."

    @pytest.mark.parametrize("terminal_width", [None, 100])
    def test_folder_table_shows_warnings_once(self, terminal_width, monkeypatch):
        stream = io.StringIO()
        if terminal_width:
            monkeypatch.setattr(stream, "isatty", lambda: True)
            monkeypatch.setenv("COLUMNS", str(terminal_width))
            monkeypatch.setenv("NO_COLOR", "1")
        codes = ("bias_unknown", "swaying", "gaps_bridged")
        warned = replace(VALID, warnings=tuple(Finding(code, "long") for code in codes))
        swayed = replace(REFUSED, warnings=(Finding("swaying", ""), Finding("swaying", "")))
        name = "name_of_a_recording.csv"
        terminal.print_folder([Outcome(name, warned), Outcome("b.csv", swayed)], stream)
        text = stream.getvalue()
        assert re.search(rf"{name} .* valid \[1 2 3\] *\n", text)
        assert re.search(r"b.csv .* refused \(rate_norm\)\s+\[2\] *\n", text)
        assert text.endswith("[1] warning: bias_unknown\n[2] warning: swaying\n[3] warning: gaps_bridged\n")
        assert max(map(len, re.sub("\x1b\\[[0-9;]*m", "", text).splitlines())) <= 100


class TestFigures:
    def test_convergence_is_unwrapped_about_the_final_heading(self):
        crossing = replace(
            CONVERGENCE, heading=np.radians([340.0, 350.0, 10.0, 1.0]), half_width=np.radians([30, 20, 12, 8.0])
        )
        axes = figures.convergence_figure(crossing, replace(VALID, heading=radians(1)), heading_true=radians(359)).axes[
            0
        ]
        valid, refused, truth = axes.get_lines()
        np.testing.assert_allclose(valid.get_ydata()[2:], [10, 1])
        np.testing.assert_allclose(refused.get_ydata()[:3], [-20, -10, 10])
        assert truth.get_ydata()[0] == pytest.approx(-1)
        axes.figure.draw_without_rendering()
        labels = [label.get_text() for label in axes.get_yticklabels()]
        assert all(0 <= float(label) < 360 for label in labels)
        band = axes.collections[0].get_paths()[0].vertices
        assert band[:, 1].min() == pytest.approx(-50)
        assert band[:, 1].max() == pytest.approx(22)

    def test_another_method_than_the_one_drawn_shows_its_own_result_at_the_end(self):
        found = replace(VALID, method="posterior", heading=radians(1), interval95=(radians(350), radians(9)))
        axes = figures.convergence_figure(CONVERGENCE, found).axes[0]
        assert axes.get_title(loc="left") == "Heading against time, by plain averaging"
        bars = axes.containers[0]
        assert bars.get_label() == "posterior, valid"
        np.testing.assert_allclose(bars[2][0].get_segments()[0][:, 1], [-10, 9], atol=1e-9)
        assert axes.get_ylim()[0] <= -10

    def test_unknown_heading_has_a_figure(self, tmp_path):
        figure = figures.heading_figure(replace(CONVERGENCE, heading=np.full(4, np.nan)), UNKNOWN)
        figures.write(figure, tmp_path / "a.png")
        assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")

    def test_a_picture_alone_says_file_heading_and_method(self, tmp_path):
        title = figures.heading_figure(CONVERGENCE, VALID, name="ship $1.csv").get_suptitle()
        assert title.startswith(r"ship \$1.csv")
        assert f"heading {wording.heading_text(degrees(VALID.heading))} ± " in title
        assert f"method {VALID.method}" in title
        refused = figures.heading_figure(replace(CONVERGENCE, heading=np.full(4, np.nan)), UNKNOWN, name="\udcff" * 200)
        assert "refused: " in refused.get_suptitle()
        assert " deg" not in refused.get_suptitle()
        figures.write(refused, tmp_path / "a.png")

    @pytest.mark.slow
    @pytest.mark.parametrize(("suffix", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")])
    def test_formats(self, tmp_path, suffix, start):
        deviation = allan_deviation(np.random.default_rng(1).standard_normal((400, 3)), rate_hz=10)
        figure = figures.heading_figure(CONVERGENCE, VALID, heading_true=radians(43), deviation=deviation)
        figures.write(figure, tmp_path / f"a{suffix}")
        assert (tmp_path / f"a{suffix}").read_bytes().startswith(start)

    def test_figures_of_the_page_are_reproducible_and_follow_the_theme(self):
        first, second = (figures.svg_text(figures.convergence_figure(CONVERGENCE, VALID), salt="a") for _ in range(2))
        assert first == second
        assert "var(--blue)" in first
        assert not re.search("|".join(figures.COLOURS), first)


class Page(HTMLParser):
    """Tags that must not be there, identifiers, references and text of a page."""

    def __init__(self, page: str):
        super().__init__()
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.text = ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in ("href", "src", "xlink:href", "srcset", "data", "action"):
                self.references.append(value)

    def handle_data(self, data):
        if self.get_starttag_text() != "<style>":
            self.text += data


@pytest.fixture(scope="module")
def deviation():
    return allan_deviation(np.random.default_rng(1).standard_normal((400, 3)) * 1e-5, rate_hz=10)


class TestPage:
    @pytest.mark.slow
    @pytest.mark.parametrize("estimate", [VALID, REFUSED, UNKNOWN], ids=["valid", "refused", "unknown"])
    def test_page_stands_alone(self, estimate, deviation):
        page = heading_page(Outcome("rec.csv", estimate), CONVERGENCE, deviation=deviation, inputs=[("axes", "frd")])
        parsed = Page(page)
        assert not {"script", "link", "img", "iframe"} & set(parsed.tags)
        assert all(reference.startswith("#") for reference in parsed.references)
        assert not re.search(r"url\((?!#)", page)
        assert "@import" not in page
        assert len(set(parsed.ids)) == len(parsed.ids)  # two figures on one page share no identifier
        assert parsed.tags.count("svg") == 3
        assert "prefers-color-scheme: dark" in page
        assert "width=device-width" in page
        assert len(page) < 300_000

    def test_valid_page(self):
        text = Page(heading_page(Outcome("rec.csv", VALID, heading_true=radians(43)), CONVERGENCE)).text
        assert "Valid" in text
        assert "40.31°" in text
        assert "31.30 to 49.30°" in text
        assert "the error is -2.69°" in text
        assert "Refused" not in text
        assert text.index("turn-on bias") < text.index("drift") < text.index("together")  # the largest part first

    def test_refused_page_says_so_in_words_and_numbers(self):
        text = Page(heading_page(Outcome("rec.csv", REFUSED), CONVERGENCE)).text
        for words in ("Refused", "must not be used", "rate_norm", RATE_NORM.message, "measured 199", "limit 4.1"):
            assert words in text
        assert "✓" not in text

    def test_file_names_and_messages_are_escaped(self):
        warned = replace(VALID, warnings=(Finding("rows_dropped", "<b>3</b> rows & more", 3.0),))
        page = heading_page(Outcome("<script>alert(1)</script>.csv", warned), CONVERGENCE, inputs=[("a", "<i>")])
        assert "<script" not in page
        assert "&lt;b&gt;3&lt;/b&gt; rows &amp; more" in page
        assert "<i>" not in page


def test_page_shows_the_disturbance_that_was_found():
    found = DisturbanceFound(1.9, 0.98, 0.02, None, masked_s=2.0, residual_ratio=1.04, explained=True)
    page = heading_page(Outcome("a.csv", replace(VALID, method="learned", disturbance=found)), CONVERGENCE)
    cells = dict(re.findall(r"<tr><td>([^<]*)</td><td class=\"n\">([^<]*)</td></tr>", page))
    assert cells["sway tones, expected number"] == "1.9"
    assert cells["bias settling, probability"] == "0.98"
    assert cells["left out as bumps"] == "2.0 s"
    assert "bias random walk, probability" not in cells
    assert "by plain averaging, not by learned" in page
    assert ">Disturbance<" not in heading_page(Outcome("a.csv", VALID), CONVERGENCE)


def test_page_draws_the_density_on_the_compass():
    angle = np.radians(np.array([350.0, 0.0, 10.0]))
    found = replace(VALID, posterior=HeadingDensity(angle, np.array([1.0, 2.0, 1.0])))
    path = re.search(r'class="density" d="M([^"]*) Z"', heading_page(Outcome("a.csv", found), CONVERGENCE))
    points = [tuple(map(float, point.split())) for point in path[1].split(" L")]
    # Outwards of the circle of radius 80 by 18 at the highest value, half of it beside; then back along the circle.
    assert np.hypot(*np.transpose(points)) == pytest.approx([89, 98, 89, 80, 80, 80], abs=0.02)
    assert points[1] == (0.0, -98.0)
    assert 'class="density"' not in heading_page(Outcome("a.csv", VALID), CONVERGENCE)


def test_turns_are_taken_out_of_the_heading_against_time():
    poses = (Pose(0.0, 40.0, radians(350.0)), Pose(50.0, 90.0, radians(80.0)), Pose(95.0, 120.0, radians(260.0)))
    turns = (Turn(40.0, 50.0, radians(90.0)), Turn(90.0, 95.0, radians(180.0)))
    turned = replace(VALID, heading=radians(260.0), poses=poses, turns=turns, method="turned")
    # In the first pose, in the turn, just behind it when the second pose is not found yet, in both others.
    along = Convergence(
        time=np.array([20.0, 45.0, 51.0, 70.0, 120.0]),
        heading=np.radians([352.0, 351.0, 350.5, 79.0, 260.0]),
        half_width=np.radians([3.0, 3.0, 3.0, 2.0, 1.0]),
        valid=np.ones(5, bool),
    )
    figure = figures.convergence_figure(along, turned)
    drawn = next(line for line in figure.axes[0].lines if line.get_label() == "heading, valid").get_ydata()
    np.testing.assert_allclose(drawn, [262.0, 261.0, 260.5, 259.0, 260.0], atol=1e-9)


def test_json_keys_are_those_of_the_design():
    example = """schema heading_deg sigma_deg interval95_deg valid reasons warnings method method_reason bundle roll_deg
        pitch_deg latitude_deg sensor duration_s rate_hz end_time_utc poses sigma_parts_deg gyro_bias_deg_h
        rate_mean_deg_h rate_norm_deg_h implied_latitude_deg gyro_bias_sigma_deg_h scale_factor_ppm
        scale_factor_sigma_ppm disturbance fitness orientation"""
    assert list(VALID.to_json()) == example.split()
    assert json.loads(json.dumps(VALID.to_json(), allow_nan=False))["schema"] == "gyronorth.heading/1"


def test_hopeless_numbers_stay_readable():
    """A gyro that reads zero: a part of sigma of any size, negative zeros, no implied latitude."""
    hopeless = replace(UNKNOWN, sigma_parts={"turn_on_bias": 1e150}, pitch=-0.0)
    lines = dict(wording.heading_lines(Outcome("zero.csv", hopeless)))
    assert lines["error budget"] == "turn-on bias > 180 deg"
    assert lines["roll, pitch"] == "unknown, 0.00 deg"
    page = heading_page(Outcome("zero.csv", hopeless), replace(CONVERGENCE, heading=np.full(4, np.nan)))
    assert "&gt; 180°" in page


def test_a_gyro_that_does_not_vary_has_a_figure():
    figure = figures.allan_figure(allan_deviation(np.zeros((400, 3)), rate_hz=10))
    assert [text.get_text() for text in figure.axes[0].texts] == ["the gyro does not vary"]
    figure.draw_without_rendering()


def test_a_file_name_that_is_no_utf8(tmp_path):
    write_table(tmp_path / "out.csv", "{}", [Outcome("a\udcff.csv", VALID)])
    assert r"a\udcff.csv" in (tmp_path / "out.csv").read_text()

"""Plots of reports: thinning, styles that differ without colour, sentences in place of empty plots, hostile names."""

import re
from base64 import b64decode
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import cv2
import jinja2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_page import require_report

from scenarios.html_page import number, page, percent
from scenarios.plot_style import (
    BAND,
    BLUE,
    COLOURS,
    ESTIMATOR_STYLES,
    INK,
    MARKERS,
    OTHER_STYLES,
    SHADE,
    WHEEL_STYLES,
    Style,
    estimator_styles,
)
from scenarios.plots import MOST_POINTS, Figure, Panel, Series, Shade, png, strips, thin

X = np.linspace(0.0, 10.0, 50)
PANEL = Panel("y [-]", "nothing was measured.", (Series("a", X, np.sin(X), Style(BLUE)),))
TEMPLATE = """{% extends "report_base.html.jinja" %}{% from "report_parts.html.jinja" import plots %}
{% block title %}t{% endblock %}{% block verdict %}<p class="verdict">All is known.</p>{% endblock %}
{% block body %}{{ plots(figure) }}{% endblock %}{% block provenance %}{% endblock %}"""


@pytest.fixture
def shown(tmp_path):
    """The page of a figure."""
    template = tmp_path / "report.html.jinja"
    template.write_text(TEMPLATE)
    return lambda figure: require_report(page(template, figure=figure))


def values(packed):
    """What plotly reads of a packed array."""
    return np.frombuffer(b64decode(packed["bdata"]), dtype=packed["dtype"])


class TestThinning:
    @given(st.integers(0, 2**32 - 1), st.integers(MOST_POINTS + 1, 40_000))
    def test_a_spike_anywhere_is_kept(self, seed, length):
        random = np.random.default_rng(seed)
        y = random.standard_normal(length)
        y[random.integers(length)], y[random.integers(length)] = 99.0, -99.0
        kept = thin(y)
        assert len(kept) <= 1.5 * MOST_POINTS
        assert (np.diff(kept) > 0).all()
        assert (y[kept].max(), y[kept].min()) == (y.max(), y.min())
        assert (kept[0], kept[-1]) == (0, length - 1)

    def test_every_bucket_keeps_its_extremes(self):
        y = np.sin(np.arange(100_000) * 0.7) * np.linspace(1.0, 2.0, 100_000)
        kept = thin(y, 400)
        for part in np.array_split(np.arange(len(y)), 100):
            inside = kept[(kept >= part[0]) & (kept <= part[-1])]
            assert y[inside].max() == pytest.approx(y[part].max(), abs=0.05)

    def test_a_short_series_is_whole(self):
        assert list(thin(np.zeros(7))) == list(range(7))

    def test_lost_samples_still_break_the_line(self):
        y = np.zeros(50_000)
        y[20_000] = np.nan
        assert np.isnan(y[thin(y)]).sum() == 1
        assert np.isnan(np.full(9000, np.nan)[thin(np.full(9000, np.nan))]).all()

    def test_a_long_log_does_not_make_a_large_plot(self):
        x = np.arange(2_000_000) * 0.001
        spec = Panel("y", "", (Series("a", x, np.sin(x), Style(BLUE)),)).spec
        assert len(spec["data"][0]["y"]["bdata"]) < 30_000

    def test_a_flag_that_is_set_once_is_seen(self):
        flag = np.zeros(500_000, dtype=bool)
        flag[321_007] = True
        (bar,) = strips(np.arange(500_000.0), {"excited": flag}, [Style(BLUE)])
        upper = values(Panel("flags", "", (bar,)).spec["data"][1]["y"])
        assert upper.max() == pytest.approx(0.36)
        assert upper.min() == pytest.approx(-0.36)


class TestStyles:
    def test_the_wheels_differ_in_colour_line_and_marker(self):
        assert list(WHEEL_STYLES) == ["fl", "fr", "rl", "rr"]
        for one, other in combinations(WHEEL_STYLES.values(), 2):
            assert one.colour != other.colour
            assert one.dash != other.dash
            assert one.marker != other.marker

    def test_estimators_differ_without_their_colour(self):
        for one, other in combinations(ESTIMATOR_STYLES.values(), 2):
            assert one.dash != other.dash
            assert one.marker != other.marker

    def test_many_estimators_all_differ(self):
        names = [*ESTIMATOR_STYLES, "EKF", "UKF", "slip-slope", "my.module:Peer"]
        styles = estimator_styles(names)
        assert list(styles) == names
        assert len({(s.colour.name, s.dash) for s in styles.values()}) == len(names)
        assert len({(s.colour.name, s.marker) for s in OTHER_STYLES}) == len(OTHER_STYLES)
        assert estimator_styles(["as_printed"])["as_printed"] == ESTIMATOR_STYLES["as printed"]

    @pytest.mark.parametrize("side", ["light", "dark"])
    def test_lines_and_text_stand_out_from_the_page(self, side):
        """WCAG 2.2, 1.4.11: 3 to 1 for lines; 1.4.3: 4.5 to 1 for text."""
        paper = {"light": "#ffffff", "dark": "#16181b"}[side]
        base = (Path(page.__code__.co_filename).parent / "report_base.html.jinja").read_text()
        assert "--paper: #fff;" in base
        assert "--paper: #16181b;" in base
        for colour in COLOURS:
            value = getattr(colour, side)
            if value.startswith("#") and colour.name != "--line":
                least = 4.5 if colour.name in ("--ink", "--grey") else 3.0
                assert contrast(value, paper) >= least, colour

    def test_no_colour_is_named_elsewhere(self):
        """One palette: colours of plots stand in plot_style, and of pages in templates."""
        root = Path(page.__code__.co_filename).parents[1]
        for folder in ("scenarios", "sim2real", "trpac", "trpac_cli", "trpac_hil", "benchmarks", "models"):
            for path in (root / folder).rglob("*.py"):
                if path.name != "plot_style.py":
                    assert not re.search(r"[\"']#[0-9a-fA-F]{6}[\"']", path.read_text()), path


def contrast(one, other):
    """The contrast of two colours after WCAG."""

    def luminance(text):
        parts = np.array([int(text[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
        linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


class TestPages:
    def test_a_plot_without_a_value_is_a_sentence(self, shown):
        lost = replace(PANEL, label="slip [-]", series=(Series("a", X, np.full(50, np.nan), Style(BLUE)),))
        found = shown(Figure("f", (PANEL, lost, replace(PANEL, label="none [-]", series=()))))
        assert len(found.specs) == 1
        assert "slip [-]: nothing was measured." in found.text
        assert "none [-]: nothing was measured." in found.text

    def test_a_figure_without_a_value_needs_no_script(self, shown):
        found = shown(Figure("f", (replace(PANEL, series=()),)))
        assert found.specs == []
        assert len(found.source) < 20_000

    def test_the_library_is_in_the_page_once(self, shown, tmp_path):
        template = tmp_path / "report.html.jinja"
        shown(Figure("f", (PANEL,)))
        whole = page(template, figure=Figure("f", (PANEL, PANEL)))
        assert whole.count("plotly.js v") == 1
        assert len(whole) < 6_000_000

    def test_points_bands_shades_and_legends(self, shown):
        series = (
            Series("band", X, X + 1.0, Style(BAND), low=X),
            Series("steps", X, X, Style(INK), "step"),
            Series("points", X, X, Style(BLUE), "points"),
            Series("", X, X, Style(BLUE), "marked", right=True),
        )
        panel = replace(
            PANEL,
            series=series,
            right_label="r [N]",
            shades=(Shade(1.0, 2.0, SHADE, "wet\n0.5"),),
            x_limits=(0, 9),
        )
        found = shown(Figure("f", (panel,)))
        data, layout = found.specs[0]["data"], found.specs[0]["layout"]
        assert [trace["mode"] for trace in data] == ["lines", "lines", "lines", "markers", "lines+markers"]
        assert data[1]["fill"] == "tonexty"
        assert data[2]["line"]["shape"] == "hv"
        assert data[4]["yaxis"] == "y2"
        assert layout["xaxis"]["range"] == [0.0, 9.0]
        assert layout["annotations"][0]["text"] == "wet<br>0.5"
        assert "band steps points" in found.text
        np.testing.assert_allclose(values(data[3]["x"]), X)

    def test_names_are_no_markup(self, shown):
        strange = "</script><b>x</b> $y_{$ \x1b[31m"
        found = shown(
            Figure(
                strange, (replace(PANEL, label=strange, series=(replace(PANEL.series[0], name=strange),)),)
            )
        )
        assert "<b>x" not in found.source
        assert found.specs[0]["data"][0]["name"].startswith("&lt;/script&gt;&lt;b&gt;x")
        assert png(
            Figure("f", (replace(PANEL, label="$x_{$", series=(replace(PANEL.series[0], name="$\\frac$"),)),))
        )

    def test_a_missing_value_is_an_error(self, tmp_path):
        (tmp_path / "report.html.jinja").write_text(TEMPLATE)
        with pytest.raises(jinja2.UndefinedError):
            page(tmp_path / "report.html.jinja")

    def test_a_text_cannot_place_the_library(self, tmp_path):
        (tmp_path / "t.html.jinja").write_text("{{ text }}<!-- plotly -->")
        assert page(tmp_path / "t.html.jinja", text="<!-- plotly -->").startswith("&lt;!-- plotly --&gt;")


def test_a_png_shows_every_kind_of_series():
    none = replace(PANEL, series=())
    series = tuple(Series(m, X, X + i, Style(BLUE, marker=m), "marked") for i, m in enumerate(MARKERS))
    many = replace(
        PANEL, series=(*series, Series("band", X, X, Style(BAND), low=X - 1.0)), y_limits=(0.0, 9.0)
    )
    pixels = cv2.imdecode(np.frombuffer(png(Figure("f", (many, none, PANEL)), "a title"), np.uint8), 1)
    assert pixels.shape[1] > 1000
    assert pixels.std() > 5.0


def test_numbers_that_are_none_say_so():
    assert number(None, 2, "not reached") == "not reached"
    assert number(float("nan")) == "not known"
    assert number(1.25, 1) == "1.2"
    assert percent(None, "not driven") == "not driven"


def test_templates_hold_no_style_of_their_own():
    """Every report extends the base; only the gap's adds rules, for what no other has."""
    root = Path(page.__code__.co_filename).parents[1]
    templates = [p for p in root.rglob("*.html.jinja") if not {".venv", "build"} & set(p.parts)]
    reports = [p for p in templates if p.name == "report.html.jinja"]
    assert len(reports) == 4
    for path in templates:
        text = path.read_text()
        if path in reports:
            assert text.startswith('{% extends "report_base.html.jinja" %}'), path
        if path.name not in ("report_base.html.jinja", "report_parts.html.jinja"):
            for tag in ("<style", "<table", "<img", "<html"):
                assert tag not in text, path

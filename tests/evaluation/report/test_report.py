"""Tables, charts, panels and the page that holds them."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import SettingsError
from zeroscd.evaluation.datasets.catalogue import open_dataset
from zeroscd.evaluation.metrics import Counts
from zeroscd.evaluation.report.charts import Chart, Line, span_of
from zeroscd.evaluation.report.figures import write_figures
from zeroscd.evaluation.report.page import Page, score_page
from zeroscd.evaluation.report.panels import (
    FALSE_RGB,
    FOUND_RGB,
    MISSED_RGB,
    check_chosen,
    choose_pairs,
    error_map,
)
from zeroscd.evaluation.report.tables import Table
from zeroscd.evaluation.run import Run, evaluate
from zeroscd.evaluation.truth import Truth

if TYPE_CHECKING:
    from pathlib import Path
    from types import ModuleType

    from zeroscd.evaluation.scores import Scores

TABLE = Table(
    title="scores",
    columns=("method", "F1"),
    rows=(("ours", "0.75"), ("R&D_50% <b>", "0.5")),
    strong=frozenset({0}),
)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


@pytest.fixture
def scores(tiny_folder: Path, out: Path, toy: ModuleType) -> Scores:
    dataset = open_dataset("folder", tiny_folder)
    return evaluate(dataset, Run(detector=toy.ToyDetector.in_frame("t1"), out=out))


def with_f1(scores: Scores, hits: list[int]) -> Scores:
    """Give many pairs whose F1 rises with their number of hits."""
    pairs = tuple(
        replace(scores.pairs[0], stem=f"{at:02}", counts=Counts(tp=hit, fp=0, fn=100 - hit, tn=0))
        for at, hit in enumerate(hits)
    )
    return replace(scores, pairs=pairs)


def test_text_is_aligned_and_marks_our_row() -> None:
    assert (
        TABLE.to_text() == "scores\n  method       F1\n> ours         0.75\n  R&D_50% <b>   0.5\n"
    )


def test_markdown_is_a_table_with_our_row_in_bold() -> None:
    lines = TABLE.to_markdown().splitlines()
    assert lines[2:] == [
        "| method | F1 |",
        "| --- | --- |",
        "| **ours** | **0.75** |",
        "| R&D_50% <b> | 0.5 |",
    ]


def test_latex_escapes_what_it_would_stumble_over() -> None:
    text = TABLE.to_latex()
    assert r"\textbf{ours} & \textbf{0.75} \\" in text
    assert r"R\&D\_50\% <b> & 0.5 \\" in text
    assert text.count(r"\hline") == 3


def test_html_shows_names_as_text_and_not_as_tags() -> None:
    text = Page(title="</title><b>", facts=("<b>",), fine_print=("<b>",), tables=(TABLE,)).to_html()
    assert "R&amp;D_50% &lt;b&gt;" in text
    assert '<tr class="ours"><td>ours</td>' in text
    assert "<b>" not in text


def test_columns_of_numbers_are_told_from_columns_of_words() -> None:
    rows = (("a", "0.5", "-", "1 px"), ("0.1", "", "2", "3"))
    assert Table(title="t", columns=("", "", "", ""), rows=rows).numeric == {1, 2}
    text = Page(title="t", facts=(), tables=(TABLE,)).to_html()
    assert '<th scope="col">method</th><th scope="col" class="number">F1</th>' in text
    assert '<td class="number">0.75</td>' in text


def test_the_page_begins_with_the_scores_and_what_puts_them_in_doubt(
    scores: Scores, out: Path
) -> None:
    pairs = tuple(replace(pair, resized=True) for pair in scores.pairs)
    text = score_page(replace(scores, pairs=pairs), out).to_html()
    places = [
        text.index(part)
        for part in ("<li>F1 <span>0.200</span></li>", 'class="warning">not as large', "<svg")
    ]
    assert places == sorted(places)
    assert 'class="warning"' not in score_page(scores, out).to_html()


def test_a_chart_puts_points_where_its_ticks_say() -> None:
    chart = Chart(
        title="a < b", x_name="x", y_name="y", lines=(), x_range=(0.0, 2.0), y_range=(0.0, 1.0)
    )
    (left, bottom), (right, top) = chart.place((0, 0)), chart.place((2, 1))
    assert left < right
    assert top < bottom  # pixels grow downwards
    assert chart.place((1.0, 0.5)) == ((left + right) / 2, (bottom + top) / 2)
    svg = chart.to_svg()
    assert "a &lt; b" in svg
    ticks = re.findall(r">([\d.]+)</text>", svg)
    assert ticks == ["0", "0.5", "1", "1.5", "2", "0", "0.2", "0.4", "0.6", "0.8", "1"]


def test_a_line_passes_through_its_points() -> None:
    line = Line(name="ours", points_xy=((0.0, 0.0), (1.0, 1.0)), marked=True)
    chart = Chart(title="t", x_name="x", y_name="y", lines=(line,))
    (x, y), _ = chart.place((0, 0)), chart.place((1, 1))
    svg = chart.to_svg()
    assert f'points="{x:.1f},{y:.1f} ' in svg
    assert svg.count("<circle") == 2


@pytest.mark.parametrize(
    ("values", "ticks"),
    [
        ([0.5, 0.7], ["0.5", "0.55", "0.6", "0.65", "0.7"]),
        ([16, 64], ["20", "40", "60"]),
        ([0.709, 0.754], ["0.71", "0.72", "0.73", "0.74", "0.75"]),
    ],
)
def test_ticks_are_round_numbers(values: list[float], ticks: list[str]) -> None:
    chart = Chart(title="t", x_name="x", y_name="y", lines=(), x_range=span_of(values))
    assert re.findall(r'middle">([\d.]+)</text>', chart.to_svg()) == ticks


def test_the_range_of_one_value_is_not_empty() -> None:
    low, high = span_of([0.5])
    assert low < 0.5 < high


def test_the_best_the_worst_and_random_others_are_shown(scores: Scores) -> None:
    chosen = choose_pairs(with_f1(scores, [50, 90, 10, 80, 30, 70, 20, 60, 40, 55]), ["04"])
    assert chosen["04"] == "chosen"
    assert [stem for stem, why in chosen.items() if why == "best"] == ["01", "03", "05"]
    assert [stem for stem, why in chosen.items() if why == "worst"] == ["02", "06", "08"]
    assert len([stem for stem, why in chosen.items() if why == "random"]) == 3


def test_a_pair_that_does_not_exist_cannot_be_shown(scores: Scores) -> None:
    check_chosen(scores.dataset, ["a"])
    with pytest.raises(SettingsError, match="'nowhere'"):
        check_chosen(scores.dataset, ["a", "nowhere"])


def test_errors_are_coloured_by_what_they_are() -> None:
    predicted = np.array([[True, True, False, False, True]])
    changed = np.array([[True, False, True, False, False]])
    valid = np.array([[True, True, True, True, False]])
    photo = np.full((1, 5, 3), 100, np.uint8)
    drawn = error_map(photo, predicted, Truth(changed=changed, valid=valid))
    assert [tuple(pixel) for pixel in drawn[0]] == [
        FOUND_RGB,
        FALSE_RGB,
        MISSED_RGB,
        (45, 45, 45),
        (0, 0, 0),
    ]


def test_the_colours_of_errors_differ_in_brightness_too() -> None:
    weights = np.array([0.2126, 0.7152, 0.0722])
    bright = sorted(float(weights @ np.array(rgb)) for rgb in (FOUND_RGB, MISSED_RGB, FALSE_RGB))
    assert min(np.diff(bright)) > 15


class Outline(HTMLParser):
    """Collects what a page refers to, and checks that its tags are closed."""

    VOID = frozenset({"meta", "link", "img", "line", "circle", "polyline"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert tag in self.VOID or self.open.pop() == tag


def test_the_page_holds_everything_and_refers_to_nothing_outside(scores: Scores, out: Path) -> None:
    page = score_page(scores, out).write(out)
    text = page.read_text(encoding="utf-8")
    outline = Outline()
    outline.feed(text)
    assert outline.open == []
    icon, *pictures = outline.sources
    assert icon == "data:,"
    assert len(pictures) == 3 * 5
    assert all(source.startswith("data:image/jpeg;base64,") for source in pictures)
    assert "script-src 'none'" in text
    assert not re.search(r"https?://|url\(", text)
    assert "0.200" in text  # the macro F1 worked out by hand


def test_our_mask_is_what_the_page_shows(scores: Scores, out: Path) -> None:
    text = score_page(scores, out, chosen=["a"]).to_html()
    match = re.search(r'alt="ours of a" src="data:image/jpeg;base64,([^"]+)"', text)
    assert match is not None
    shown = cv2.imdecode(np.frombuffer(base64.b64decode(match[1]), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert shown is not None
    assert shown[:, :16].min() > 200
    assert shown[:, 24:].max() < 50


def test_a_figure_shows_the_very_drawing_of_the_page(out: Path) -> None:
    points = ((0.0, 0.0), (1.0, 0.5))
    chart = Chart(title="t", x_name="x", y_name="y", lines=(Line(name="one", points_xy=points),))
    png, _ = write_figures(out, charts=[chart])
    picture = np.asarray(Image.open(png).convert("RGB"))
    scale = picture.shape[1] / chart.size_wh[0]
    assert picture.shape[0] / chart.size_wh[1] == pytest.approx(scale, rel=0.01)
    blue = (picture == (0, 114, 178)).all(axis=2)
    for at in (0.25, 0.75):
        x, y = (round(scale * value) for value in chart.place((at, at / 2)))
        assert blue[y - 2 : y + 3, x].any()
        assert not blue[y - 12, x]


def test_tables_are_written_for_papers_too(scores: Scores, out: Path) -> None:
    score_page(scores, out).write(out)
    assert "| a | 0.400 | 0.500 | 0.333 |" in (out / "tables.md").read_text()
    assert r"\begin{tabular}" in (out / "tables.tex").read_text()


def test_charts_and_panels_are_written_as_png_and_pdf(scores: Scores, out: Path) -> None:
    page = score_page(scores, out)
    paths = write_figures(out, charts=page.charts, panels=page.panels)
    names = ["chart-1.png", "chart-1.pdf", "panels.png", "panels.pdf"]
    assert [path.name for path in paths] == names
    assert all(path.read_bytes()[:4] in (b"\x89PNG", b"%PDF") for path in paths)
    before = [path.read_bytes() for path in paths[:2]]
    assert [path.read_bytes() for path in write_figures(out, charts=page.charts)] == before

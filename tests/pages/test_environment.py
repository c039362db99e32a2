from __future__ import annotations

import re
from importlib.resources import files

import pytest
from jinja2 import UndefinedError

from zeroscd.evaluation.report.charts import Chart, Line
from zeroscd.pages import asset, render

HOSTILE = "</title></script><script>alert(1)</script>\"'<img src=x onerror=alert(1)> {{ 7 * 7 }}"
TEMPLATES = {
    file.name: file.read_text(encoding="utf-8")
    for file in files("zeroscd.pages").joinpath("templates").iterdir()
}


def chart(text: str) -> Chart:
    line = Line(name=text, points_xy=((0.0, 0.0), (1.0, 1.0)))
    return Chart(title=text, x_name=text, y_name=text, lines=(line,))


def test_what_a_template_is_given_stays_text() -> None:
    drawn = render("chart.svg", chart=chart(HOSTILE))
    plain = render("chart.svg", chart=chart("plain"))
    assert re.findall("<[a-z/]+", drawn) == re.findall("<[a-z/]+", plain)
    assert drawn.count("{{ 7 * 7 }}") == 5  # a name is not a template


def test_a_value_that_is_missing_is_an_error_and_no_gap() -> None:
    with pytest.raises(UndefinedError, match="chart"):
        render("chart.svg")


def test_nothing_in_an_asset_ends_the_element_that_holds_it() -> None:
    inside = set(re.findall(r'"(\w+\.(?:js|css))"', "".join(TEMPLATES.values())))
    assert inside == {"style.css", "viewer.js", "review.js", "survey.js", "refine_masks.js"}
    for name in inside:
        assert "</" not in asset(name)
        assert not re.search(r"url\(|@import|https?:", asset(name))


def test_no_template_runs_anything_inline() -> None:
    """A Content-Security-Policy would refuse it."""
    for name, text in TEMPLATES.items():
        assert not re.search(r"\son[a-z]+=|javascript:", text)
        inline = [tag for tag in re.findall(r"<script[^>]*>", text) if " src=" not in tag]
        assert len(inline) == (name == "base.html"), name
        assert "safe" not in re.findall(r"\|\s*(\w+)", text)

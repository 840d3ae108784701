"""Pages hold what they show, and refuse to leave out what they should."""

import base64
import re

import jinja2
import matplotlib
import pytest
from matplotlib.figure import Figure

from fifesim.output import report


@pytest.fixture
def template(tmp_path):
    def write(content):
        path = tmp_path / "own.html.j2"
        path.write_text(f'{{% extends "page.html.j2" %}}{{% block content %}}{content}{{% endblock %}}')
        return path

    return write


def drawn():
    figure = Figure(figsize=(2, 1))
    figure.subplots().plot([0, 1])
    return report.png(figure, 50)


def test_a_picture_is_in_the_page_as_it_is(template):
    page = report.page_html(template('<img src="{{ picture | embedded }}">'), picture=drawn())
    (content,) = re.findall(r'src="data:image/png;base64,([^"]*)"', page)
    assert base64.b64decode(content) == drawn()


def test_a_picture_has_so_many_pixels(template):
    # Width and height stand at bytes 16 to 24 of a PNG.
    assert [int.from_bytes(drawn()[start : start + 4]) for start in (16, 20)] == [100, 50]


def test_text_is_not_markup(template):
    assert "a &lt; b" in report.page_html(template("{{ text }}"), text="a < b")


def test_a_name_without_a_value_is_an_error(template):
    with pytest.raises(jinja2.UndefinedError, match="forgotten"):
        report.page_html(template("{{ forgotten }}"))


def test_versions_are_on_every_page(template):
    assert f"matplotlib {matplotlib.__version__}" in report.page_html(template(""))


def test_zero_has_no_sign():
    assert [report.fixed(value, 3, sign=True) for value in (-4e-4, 4e-4, -6e-4, 6e-4)] == [
        "0.000", "0.000", "−0.001", "+0.001",
    ]  # fmt: skip
    assert report.fixed(-0.0, 3) == "0.000"

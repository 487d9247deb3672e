import re
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser

import numpy as np
import pytest

from evaluated_maps.examples import solved_example
from trigpoint.events.observed import EventRefused
from trigpoint.geodesy.uncertainty import ellipses_of
from trigpoint_evaluation.app import evaluate_truth
from trigpoint_evaluation.core.draws import LeaveOutDraws, left_out_curve, untied_residuals_m
from trigpoint_evaluation.report.content import LeaveOutCurves, ReportContent, UntiedResiduals
from trigpoint_evaluation.report.map_figure import Extent, extent_around, magnification
from trigpoint_evaluation.report.page import report_page
from trigpoint_evaluation.report.tables import number


@cache
def content() -> ReportContent:
    example, draws = solved_example(), LeaveOutDraws(draws=5, seed=0)
    curve = left_out_curve(example.reduction, draws)
    return ReportContent(
        evaluated=example.evaluated,
        anchors=example.anchors,
        poses=example.poses,
        refusals=(
            EventRefused(
                source="vehicle-1", reason="time order", detail="<b>1 h</b> back", schema_name="", payload=b""
            ),
        ),
        versions=(("trigpoint", "0.1.0"),),
        untied=UntiedResiduals(labels=example.reduction.labels, residual_m=untied_residuals_m(example.reduction)),
        curves=LeaveOutCurves(everywhere=curve, blocked=curve, image="image-1-1", within_image=curve[:30]),
        truth=evaluate_truth(example.evaluated, example.truth),
    )


@cache
def page() -> str:
    return report_page(content())


class Outside(HTMLParser):
    """Gathers every address the page would load, and every identifier."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.identifiers: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value for name, value in attrs if value and name in ("src", "href", "xlink:href", "data")]
        self.identifiers += [value for name, value in attrs if value and name == "id"]


def read_page() -> Outside:
    parser = Outside()
    parser.feed(page())
    return parser


def test_the_page_loads_nothing_from_outside() -> None:
    assert [address for address in read_page().addresses if not address.startswith("#")] == []
    assert "@import" not in page()
    assert re.findall(r"url\((?!#|\"#|'#)", page()) == []


def test_every_picture_s_parts_are_defined_once_on_the_page() -> None:
    parser = read_page()
    wanted = {address.removeprefix("#") for address in parser.addresses}
    assert wanted <= set(parser.identifiers)
    assert len(set(parser.identifiers)) == len(parser.identifiers)


def test_the_same_map_gives_the_same_page() -> None:
    assert report_page(content()) == page()


@pytest.mark.parametrize(
    "title",
    [
        "The map",
        "Around the anchors",
        "Against truth",
        "Held-out anchors",
        "Residuals before and after",
        "Images and anchors",
        "The filter&#39;s gate",
        "How it came about",
    ],
)
def test_the_page_has_every_section(title: str) -> None:
    assert f"<h2>{title}</h2>" in page()


def test_colours_are_the_page_s_so_that_dark_and_light_are_legible() -> None:
    colours = set(re.findall(r"(?:fill|stroke): (#[0-9a-f]{6})", page()))
    assert colours == set()
    assert "prefers-color-scheme: dark" in page()


def test_what_was_refused_is_shown_as_text() -> None:
    assert "&lt;b&gt;1 h&lt;/b&gt; back" in page()


def test_the_offset_images_share_is_said_to_be_unobservable() -> None:
    assert "The offset that all images share cannot be observed" in page()


def test_ellipses_drawn_too_large_say_how_many_times() -> None:
    assert re.search(r"95 % ellipse, drawn \d+× too large", page())


def test_an_anchor_not_tied_is_listed_with_its_reason() -> None:
    assert "two landmarks within 1.5 m" in page()


def test_a_map_without_anchors_truth_or_poses_is_reported_too() -> None:
    bare = replace(content(), anchors=(), untied=None, curves=None, truth=None, poses=(), refusals=())
    solved = replace(bare.evaluated.solved, anchors=(), images=(), landmarks=())
    text = report_page(replace(bare, evaluated=replace(bare.evaluated, solved=solved, verdicts=())))
    assert "Ingest refused nothing." in text
    assert "Held-out anchors" not in text


def test_a_typical_ellipse_is_brought_to_a_size_that_is_seen() -> None:
    covariance_m2 = np.tile(0.01 * np.eye(2), (9, 1, 1))
    extent = Extent(0.0, 0.0, 1000.0, 800.0)
    drawn_m = magnification(covariance_m2, extent) * 2.448 * ellipses_of(covariance_m2)[0, 0]
    assert 0.002 < drawn_m / extent.width_m < 0.01  # of the picture: 1.5 to 8 pixels of 800


def test_an_extent_holds_every_point_it_is_around() -> None:
    point_m = np.random.default_rng(0).uniform(-100.0, 300.0, (50, 2))
    assert extent_around([point_m]).holds(point_m).all()


def test_numbers_are_read_by_people() -> None:
    assert (number(-1234.5, 1), number(float("nan"))) == ("\u22121\u202f234.5", "–")

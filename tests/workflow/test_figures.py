from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from errorscreen.data.observations import Observation
from errorscreen.events import Event
from errorscreen.workflow import Outcome
from errorscreen.workflow.figures import figures
from tests.report.samples import diagnosis, method, result

TIME = np.arange(400) * 0.02


def error_image(until=np.inf):
    """Picture of an error that only P has, from 0.7 to 3.2 s after the event and at 1.2 Hz; nothing is left of it."""
    noise = 0.01 * np.random.default_rng(0).standard_normal((2, len(TIME)))
    swing = 0.1 * np.sin(2 * np.pi * 1.2 * TIME) * np.exp(-(((TIME - 3.9) / 0.5) ** 2))
    before = np.stack([swing, np.zeros(len(TIME))])
    noise[:, until <= TIME] = np.nan
    seen = Observation(Event(TIME, "trip", start=2.0), noise, np.full(2, 0.01), ("P", "Q"), ("pu", "pu"))
    found = result(
        diagnosis=diagnosis(),
        calibration=(replace(method("map"), selection="all", level=float("nan")),),
        screening=(),
    )
    study = SimpleNamespace(
        f_nominal=50.0,
        observation=seen,
        observations=(seen,),
        roles=("fit",),
        run=SimpleNamespace(random_state=0),
    )
    outcome = Outcome(study, found, {"nominal": (before,), "map on all": (np.zeros_like(before),)})
    return next(figure for figure in figures(outcome) if figure.section == "errors")


def outlines(image):
    return {
        axes.get_title(): [patch.get_bbox().extents for patch in axes.patches]
        for axes in image.figure.axes
        if axes.get_title()
    }


def test_the_picture_of_an_error_outlines_where_it_is_more_than_noise():
    image = error_image()
    found = outlines(image)
    (cell,) = found.pop("P, before")
    # oscillation: from 0.5 s to 3 s after a fault that is taken to last 0.2 s; swings: 0.4 to 2.5 Hz
    np.testing.assert_allclose(cell, [2.7, 0.4, 5.2, 2.5], rtol=0.05)
    assert found == {"Q, before": [], "P, after": [], "Q, after": []}
    assert "more than noise" in image.caption
    assert image.caption.endswith("1 of 32 before, 0 of 32 after.")
    again = outlines(error_image())
    np.testing.assert_array_equal(again["P, before"], [cell])


def test_nothing_is_outlined_where_too_little_was_measured_to_tell():
    image = error_image(until=2.01)
    assert not any(outlines(image).values())
    assert image.caption.endswith("ends of the record.")

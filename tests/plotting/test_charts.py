import io
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

from errorscreen import plotting
from errorscreen.cases.demo import demo_recordings
from errorscreen.data.observations import Observation
from errorscreen.events import Event
from errorscreen.exceptions import InputError
from errorscreen.plotting.error_images import DYNAMIC_RANGE
from errorscreen.simulators import PlantSimulator

TIME = np.linspace(0, 4, 81)
NAMES = ["Xd", "Tj", "D"]


def observation(empty=False):
    values = np.stack([np.where(TIME < 1, 0.7, 0.5), np.full(81, np.nan), 0.1 * TIME])
    if empty:
        values[:] = np.nan
    return Observation(Event(TIME, start=1.0), values, np.full(3, 0.01), ("P", "Q", "f"), ("pu", "pu", ""))


def lines(axes):
    return {line.get_label(): line for line in axes.lines}


def drawn(figure):
    """Everything must survive being drawn."""
    assert isinstance(figure, Figure)
    figure.savefig(io.BytesIO(), format="svg")
    return figure


def test_responses_show_measured_simulated_and_event():
    seen = observation()
    before, after = seen.values + 0.1, seen.values + 0.01
    figure = drawn(plotting.plot_responses(seen, {"before": before, "after": after}))
    assert [axes.get_ylabel() for axes in figure.axes] == ["P in pu", "f"]  # Q was not measured
    power = lines(figure.axes[0])
    np.testing.assert_array_equal(power["measured"].get_ydata(), seen.values[0])
    np.testing.assert_array_equal(power["after"].get_ydata(), after[0])
    assert [1.0, 1.0] in [list(line.get_xdata()) for line in figure.axes[0].lines]
    assert figure.axes[-1].get_xlabel() == "time in s"
    cut = plotting.plot_responses(seen, {}, window=(0.5, 2.0))
    assert cut.axes[0].get_xlim() == (0.5, 2.0)


def test_fits_of_several_recordings_stand_side_by_side():
    fitted, held_out, _ = demo_recordings(0)
    plant = PlantSimulator("synchronous_machine", fitted)
    recordings = [plant.observe(recording) for recording in (fitted, held_out[0])]
    wrong = plant.with_nominal(1.1 * plant.parameters.nominal)
    figure = drawn(plotting.plot_comparison(recordings, {"before": wrong, "after": plant}))
    assert [axes.get_ylabel() for axes in figure.axes] == ["P in pu", "", "Q in pu", ""]
    assert [axes.get_title() for axes in figure.axes[:2]] == [o.event.name for o in recordings]
    for r, n in np.ndindex(2, 2):
        curves = lines(figure.axes[2 * r + n])
        np.testing.assert_array_equal(curves["measured"].get_ydata(), recordings[n].values[r])
        np.testing.assert_array_equal(curves["before"].get_ydata(), wrong.baseline(recordings[n].event)[r])


def test_bars_fall_and_those_not_selected_are_pale():
    axes = drawn(plotting.plot_bars({"D": 1.0, "Xd": 4.0, "Tj": 2.0}, "contribution", selected=["Xd"])).axes[
        0
    ]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["Xd", "Tj", "D"]
    assert [bar.get_width() for bar in axes.patches] == [4.0, 2.0, 1.0]
    colours = [bar.get_facecolor() for bar in axes.patches]
    assert colours[0] != colours[1] == colours[2]


def test_error_images_share_the_scale_of_a_channel():
    energy = np.zeros((2, 5, 10))
    energy[0, 2, 4], energy[1, 1, 1] = 100.0, 3.0
    frequencies, times = np.geomspace(0.5, 8, 5), np.linspace(0, 4, 10)
    figure = drawn(
        plotting.plot_error_images(
            {"before": energy, "after": 0.1 * energy}, frequencies, times, ("P", "Q"), event_time=1.0,
            cone=2 / frequencies,
        )
    )  # fmt: skip
    images = [axes.collections[0] for axes in figure.axes if axes.get_title()]
    assert [round(float(image.get_array().max()), 6) for image in images] == [0.0, -10.0, 0.0, -10.0]
    assert all(image.get_array().min() == -DYNAMIC_RANGE for image in images)
    first = figure.axes[0]
    assert (first.get_title(), first.get_yscale(), first.get_ylim()) == ("P, before", "log", (0.5, 8.0))
    assert any(list(line.get_xdata()) == [1.0, 1.0] for line in first.lines)


def test_what_is_more_than_noise_is_outlined_within_the_image():
    frequencies, times = np.geomspace(0.5, 8, 5), np.linspace(0, 4, 10)
    cells = [
        ("P", (1.0, 1.5), (1.0, 2.0)),
        ("P", (2.0, 9.0), (2.0, np.inf)),
        ("P", (2.0, 4.0), (0.0, 0.4)),  # below all that is shown
        ("Q", (1.0, 1.1), (0.0, 1.0)),
    ]
    images = {"before": np.ones((2, 5, 10)), "after": np.ones((2, 5, 10))}
    figure = drawn(
        plotting.plot_error_images(images, frequencies, times, ("P", "Q"), outlined={"before": cells})
    )
    panels = {axes.get_title(): axes for axes in figure.axes if axes.get_title()}
    assert {k: len(axes.patches) for k, axes in panels.items()} == {
        "P, before": 2, "P, after": 0, "Q, before": 1, "Q, after": 0,
    }  # fmt: skip
    inner, cut = (patch.get_bbox() for patch in panels["P, before"].patches)
    np.testing.assert_allclose(inner.extents, [1.0, 1.0, 1.5, 2.0], atol=0.05)
    np.testing.assert_allclose(cut.extents, [2.0, 2.0, panels["P, before"].get_xlim()[1], 8.0], atol=0.2)
    assert inner.y1 < 2.0 < cut.y0  # so that it shows which ones beside each other are meant
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["more than noise"]
    assert not plotting.plot_error_images(images, frequencies, times, ("P", "Q")).legends


def test_an_error_of_zero_can_be_drawn():
    drawn(plotting.plot_error_images({"after": np.zeros((1, 4, 6))}, [1, 2, 4, 8], np.arange(6.0), ["P"]))


def test_rankings_stand_in_one_order_and_mark_the_selected():
    figure = drawn(
        plotting.plot_rankings(
            {"cnn": {"Xd": 1.0, "Tj": 4.0, "D": 0.0}, "random": {"D": 0.5, "Xd": 0.25, "Tj": 0.1}},
            selected={"cnn": ["Tj"], "random": ["D"]},
        )
    )
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == ["Tj", "Xd", "D"]
    widths = [[bar.get_width() for bar in axes.patches] for axes in figure.axes]
    assert widths == [[1.0, 0.25, 0.0], [0.2, 0.5, 1.0]]
    pale = [
        [bar.get_facecolor() == figure.axes[0].patches[1].get_facecolor() for bar in axes.patches]
        for axes in figure.axes
    ]
    assert pale == [[False, True, True], [True, True, False]]


def test_contributions_of_zero_can_be_drawn():
    drawn(plotting.plot_rankings({"cnn": dict.fromkeys(NAMES, 0.0)}))


def test_intervals_are_relative_to_nominal():
    figure = drawn(
        plotting.plot_intervals(
            NAMES, [2.0, 10.0, 0.0], [[1, 3], [5, 15], [-1, 1]], [2.5, 10, 0.5], [[2, 3], [9, 11], [0, 1]],
            identifiable=[True, False, True], scales=[2.0, 10.0, 1.0],
        )
    )  # fmt: skip
    axes = figure.axes[0]
    assert lines(axes)["value"].get_xdata() == pytest.approx([25.0, 50.0])
    assert lines(axes)["value, not identifiable"].get_xdata() == pytest.approx([0.0])
    assert [(bar.get_x(), bar.get_width()) for bar in axes.patches] == [(-50, 100), (-50, 100), (-100, 200)]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: plotting.plot_responses(observation(), {"a": np.zeros((2, 81))}),
            r"response 'a' has shape \(2, 81\)",
        ),
        (lambda: plotting.plot_responses(observation(empty=True), {}), "no channel was measured"),
        (
            lambda: plotting.plot_error_images({"a": np.zeros((1, 2, 2))}, [1, 2], [0, 1, 2], ["P"]),
            "energy 'a'",
        ),
        (
            lambda: plotting.plot_error_images(
                {"a": np.zeros((1, 2, 3))}, [1, 2], [0, 1, 2], ["P"], outlined={"a": [("U", (0, 1), (1, 2))]}
            ),
            "there is no image 'a' of a channel 'U'",
        ),
        (lambda: plotting.plot_rankings({}), "there is no screener"),
        (lambda: plotting.plot_bars({}, "contribution"), "there is no value"),
        (
            lambda: plotting.plot_rankings({"a": {"x": 1.0}, "b": {"y": 1.0}}),
            "screener 'b' ranks other parameters",
        ),
        (lambda: plotting.plot_intervals(["a"], [1.0], [[0, 1]], [1.0], [1.0]), "intervals has shape"),
        (lambda: plotting.plot_intervals(["a"], [0.0], [[0, 1]], [1.0], [[0, 1]]), "a scale is not positive"),
    ],
)
def test_what_does_not_fit_is_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_no_figure_is_left_behind():
    """The state of pyplot would grow with every report."""
    plotting.plot_rankings({"cnn": {"Xd": 1.0}})
    assert "matplotlib.pyplot" not in sys.modules or not sys.modules["matplotlib.pyplot"].get_fignums()

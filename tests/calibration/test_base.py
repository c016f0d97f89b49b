"""What every calibrator shows of its fit."""

import pickle

import numpy as np
import pytest
from joblib import Parallel, delayed
from sklearn.base import clone
from sklearn.exceptions import NotFittedError

from errorscreen.calibration import BaseCalibrator, MAPCalibrator, PSOCalibrator
from errorscreen.cases.demo import demo_recordings
from errorscreen.simulators import PlantSimulator
from tests.toys import TIME, Pulse, oscillator

SIMULATOR = oscillator()
RECORDINGS = [
    SIMULATOR.record({"omega": 7.0, "gain": 1.2}, 0.02, seed=0),
    SIMULATOR.record({"omega": 7.0, "gain": 1.2}, 0.02, seed=1, event=Pulse(TIME, name="short", start=0.5)),
]
CALIBRATORS = [
    MAPCalibrator(SIMULATOR, ["omega", "gain"], n_starts=2, library_size=16, random_state=0),
    PSOCalibrator(SIMULATOR, ["omega", "gain"], n_particles=5, n_iterations=4, random_state=0),
]


@pytest.fixture(params=CALIBRATORS, ids=lambda c: type(c).__name__)
def fitted(request):
    return clone(request.param).fit(RECORDINGS)


def test_a_base_calibrator_cannot_be_built():
    with pytest.raises(TypeError, match="abstract"):
        BaseCalibrator()


def test_the_table_has_nominal_and_fitted_values(fitted):
    table = fitted.to_frame()
    assert list(table.index) == ["omega", "gain"]
    assert table["nominal"].tolist() == [SIMULATOR.parameters[name].nominal for name in table.index]
    assert table["value"].tolist() == list(fitted.values_.values())


def test_the_summary_has_a_row_for_each_parameter(fitted):
    lines = fitted.summary().splitlines()
    assert lines[0] == type(fitted).__name__
    assert lines[-2].split()[0] == "omega"
    assert f"{fitted.values_['omega']:.4g}" in lines[-2]


def test_the_figure_compares_before_and_after_for_each_recording_and_channel(fitted):
    figure = fitted.plot()
    assert len(figure.axes) == len(RECORDINGS) * len(SIMULATOR.channels)
    lines = {line.get_label(): line.get_ydata() for line in figure.axes[0].lines}
    np.testing.assert_array_equal(lines["before"], SIMULATOR.baseline(RECORDINGS[0].event)[0])
    np.testing.assert_array_equal(lines["after"], fitted.predict(RECORDINGS[0].event)[0])
    assert len(fitted.plot(RECORDINGS[1]).axes) == len(SIMULATOR.channels)


def test_repr_is_short_and_a_notebook_shows_a_table(fitted):
    assert type(fitted).__name__ in repr(fitted)
    assert len(repr(fitted)) < 200
    assert fitted._repr_html_().startswith("<table>")
    assert fitted._repr_mimebundle_()["text/html"] == fitted._repr_html_()
    assert "not fitted" in repr(clone(fitted))


def test_what_is_not_fitted_shows_nothing(fitted):
    for method in ("to_frame", "summary", "plot"):
        with pytest.raises(NotFittedError):
            getattr(clone(fitted), method)()


def test_a_fit_travels_between_processes_and_holds_no_more_than_its_result():
    recording, _, _ = demo_recordings(0)
    plant = PlantSimulator("synchronous_machine", recording)
    fit = MAPCalibrator(plant, n_starts=2, library_size=256, random_state=0).fit(recording)
    given = len(pickle.dumps((plant, plant, fit.observations_)))
    assert len(pickle.dumps(fit)) < given + 70_000
    (again,) = Parallel(n_jobs=2)([delayed(lambda x: x)(fit)])
    assert again.starts_ == fit.starts_
    np.testing.assert_array_equal(again.theta_, fit.theta_)
    np.testing.assert_array_equal(again.predict(recording), fit.predict(recording))
    np.testing.assert_array_equal(again.sample_posterior(3, 0), fit.sample_posterior(3, 0))

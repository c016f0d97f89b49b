"""Standard models driven by the voltage that another program recorded."""

import numpy as np
import pytest

from errorscreen.bench.reference_models import between_rows, play
from errorscreen.models.dyr import read_dyr
from tests.models.imposed import needs, rms, table


@pytest.mark.parametrize("T", [0.008, 0.02, 0.06])
@pytest.mark.parametrize(
    "time", [0.02 * np.arange(9), np.array([0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.11, 0.12])]
)
def test_a_decay_faster_than_the_rows_is_seen(time, T):
    def voltage(t):
        return 0.9 + 0.1j - 0.2 * t * t + (0.2 - 0.1j) * np.exp(-t / T)

    at = np.linspace(time[0], time[-1], 200)
    assert np.abs(between_rows(5.0 + time, voltage(time), 5.0 + at) - voltage(at)).max() < 2e-3
    np.testing.assert_allclose(between_rows(time, voltage(time), time), voltage(time), atol=1e-12)


def test_a_few_rows_are_a_spline():
    time = 0.1 * np.arange(5)
    np.testing.assert_allclose(between_rows(time, time**3 + 0j, np.array([0.05, 0.33])), [0.05**3, 0.33**3])


@pytest.mark.parametrize("case", ["GENSAL", "HYGOV"])
def test_salient_poles_at_the_recorded_voltage(case):
    folder = needs("openipsl_smib") / case
    device, seen = read_dyr(folder / "unit.dyr").unit(), table(folder / "trajectory.csv")
    start = {"P": seen["P_pu"][0], "Q": seen["Q_pu"][0]}
    options = {"f_nominal": 50.0, "power": seen["PMECH_pu"][0]}
    found = play(
        device, seen["time_s"], seen["V_pu"], seen["V_angle_rad"], start, ["P", "Q", "omega"], **options
    )
    assert rms(found["P"] - seen["P_pu"]) < 4e-5
    assert rms(found["Q"] - seen["Q_pu"]) < 2e-5
    assert rms(found["omega"] - 1.0 - seen["speed_dev_pu"]) < 5e-7

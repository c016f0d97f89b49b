"""Recordings of the three kinds that the project is developed with; they are not part of it."""

from pathlib import Path

import numpy as np
import pytest

from errorscreen.data import Column, read_csv

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


def path(*parts):
    file = DATA.joinpath(*parts)
    if not file.is_file():
        pytest.skip(f"{file} is not on this machine")
    return file


def test_grid_fault():
    columns = {
        "V": "V_mag",
        "angle": Column("V_ang_rad", unit="rad"),
        "f": Column("f_Hz", unit="Hz"),
        "P": Column("P_pu1000", unit="pu", base=1000.0),
        "Q": Column("Q_pu1000", unit="pu", base=1000.0),
    }
    file = path("grid_fault_recording", "recording.csv")
    rec = read_csv(file, columns, base_mva=737.0, f_nominal=60.0).window(None, 4.1)
    assert rec.event_time == pytest.approx(1.03, abs=0.02)
    assert rec.initial("VPQ") == pytest.approx(
        {"V": 0.986, "P": 0.6235 / 0.737, "Q": 0.0225 / 0.737}, abs=1e-3
    )
    # P toggles by 1 of its steps of 1.4e-3: less than its resolution
    assert rec.channel("P").noise == pytest.approx(1.4075e-3 / np.sqrt(12) / 0.737, rel=0.01)
    assert any(s.startswith("P scatters less") for s in rec.assumptions)
    phasor = read_csv(
        file, {"V": Column(real="V_real", imag="V_imag"), "P": columns["P"]}, base_mva=737.0, f_nominal=60.0
    )
    inner = phasor.time <= 4.1
    np.testing.assert_allclose(phasor.channel("V").values[inner], rec.channel("V").values, atol=1e-6)
    turned = phasor.channel("angle").values[inner] - rec.channel("angle").values
    np.testing.assert_allclose(turned, 0, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "event", "names"),
    [
        ("VoltVarMode__AlsetLabInverter_Volt_Var_Control_343V_325V", 6.87, "VQ"),
        ("VoltVarMode__AlsetLabInverter_Volt_Var_Control_343V_361V", 19.04, "VQ"),
        ("VoltageRideThrough__CircuitBreakerLogic", 6.40, "VPQ"),
    ],
)
def test_inverter(name, event, names):
    columns = {
        "V": Column("VM", unit="V"),
        "Q": Column("Q_experiment", unit="var"),
        "P": Column("P_experiment", unit="W") if "P" in names else Column(value=2685.0, unit="W"),
    }
    rec = read_csv(path("pv_inverter", name + ".csv"), columns, base_mva=5e-3, base_kv=0.343, f_nominal=60.0)
    assert rec.event_time == pytest.approx(event, abs=0.05)
    assert set(rec.names) == set(names)
    assert rec.initial("P")["P"] == pytest.approx(0.537, abs=0.001)
    assert 0.5 / 5000 < rec.channel("Q").noise < 2.5 / 5000  # 1 to 2 var are known
    assert sum("repeats each reading about 2 times" in s for s in rec.assumptions) == len(names)
    assert any(s.startswith("Samples are 0.04") for s in rec.assumptions)
    uniform = rec.resample(0.05)
    inner = uniform.channel("Q").values[5:-10]
    assert np.isfinite(inner).mean() > 0.99


@pytest.mark.parametrize("role", ["over", "under"])
def test_inverter_power_factor(role):
    """P and Q of one of three phases."""
    voltage = {"over": "VOLTAGE", "under": "EXPERIMENT_VOLTAGE"}[role]
    columns = {
        "V": Column(voltage, unit="V"),
        "P": Column("EXPERIMENT_P", unit="W", per_phase=True),
        "Q": Column("EXPERIMENT_Q", unit="var", per_phase=True),
    }
    file = path("pv_inverter", f"PowerFactorVariance__AlsetLabInverter_{role}_pf_unity_to_090.csv")
    rec = read_csv(file, columns, base_mva=5e-3, base_kv=0.35057, f_nominal=60.0)
    assert rec.initial("VP") == pytest.approx({"V": 1.0, "P": 3 * 641 / 5000}, abs=1e-3)


def test_commercial_simulation():
    machine = read_csv(
        path("psse_three_bus", "genrou_sexs.csv"),
        {"V": "V2", "P": Column("P103_101_MW", unit="MW"), "Q": Column("Q103_101_Mvar", unit="Mvar")},
        base_mva=100.0,
        f_nominal=60.0,
    )
    assert machine.event_time == pytest.approx(1.005)
    assert machine.initial("P")["P"] == pytest.approx(-1.34648)
    plant = read_csv(
        path("psse_three_bus", "regca_reecb_repca_default.csv"),
        {name: name for name in "VPQ"},
        base_mva=100.0,
        f_nominal=60.0,
    )
    assert plant.event_time == pytest.approx(1.005)
    assert 0 < plant.channel("P").noise < 1e-4


def test_rows_of_dynawo_at_one_instant():
    columns = {
        "P": Column("SynchronousGenerator_generator_PGenPu", unit="pu", base=100.0),
        "Q": Column("SynchronousGenerator_generator_QGenPu", unit="pu", base=100.0),
    }
    file = path("dynawo_case_1", "raw_measured.csv")
    rec = read_csv(file, columns, base_mva=500.0, f_nominal=50.0, on_duplicate="last")
    assert (np.diff(rec.time) > 0).all()
    assert rec.channel("P").values[0] == pytest.approx(4.751011 / 5.0)
    assert rec.channel("Q").values[0] == pytest.approx(1.561898 / 5.0)

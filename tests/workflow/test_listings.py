"""What exists, from the command line."""

import pytest

from errorscreen.cli import main
from errorscreen.effects import EFFECTS
from errorscreen.models.standard import PARTS


def told(capsys, *arguments):
    assert main([*arguments]) == 0
    return capsys.readouterr().out


def test_all_effects_and_models_are_listed(capsys):
    effects = told(capsys, "effects")
    assert all(f"\n{e.name} " in effects for e in EFFECTS.values() if e.kind != "latent")
    models = told(capsys, "models")
    assert all(f"\n{name} " in models for name in {part.name for part in PARTS.values()})
    assert "\npv_plant " in models


def test_one_of_them_in_full(capsys):
    assert "a: 1: out of service, 2: wrong sign" in told(capsys, "effects", "stabiliser_acting")
    # two effects of this name, for different devices
    assert told(capsys, "effects", "exciter").count("Equation: ") == 2
    constants = [line.split()[0] for line in told(capsys, "models", "TGOV1").splitlines()[2:]]
    assert constants == ["R", "T1", "VMAX", "VMIN", "T2", "T3", "Dt"]  # the order of the record


@pytest.mark.parametrize("kind", ["effects", "models"])
def test_an_unknown_name_has_the_nearest_ones(capsys, kind):
    assert main([kind, "TGOV2" if kind == "models" else "stabilizer"]) == 2
    assert f"did you mean '{'TGOV1' if kind == 'models' else 'stabiliser'}" in capsys.readouterr().err

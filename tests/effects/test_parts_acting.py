"""Parts of a file that did not act, and parts that it lacks, in the words of the file."""

import pytest

from errorscreen.discovery.judge.ranking import NamedEffect
from errorscreen.effects import EFFECTS
from errorscreen.effects.parts_acting import STABILISER_ACTING
from errorscreen.models import SYNCHRONOUS_MACHINE
from errorscreen.models.dyr import DyrFile
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators.assembly import library_of

MACHINE = "101 'GENROU' 1   6.0 0.04 0.8 0.06 4.0 0.0 1.8 1.7 0.3 0.5 0.22 0.15 0.0 0.0 /\n"


def titles(device):
    return {effect.name: effect.title for effect in library_of(device)}


def test_titles_name_the_models_and_the_unit_of_the_file():
    file = DyrFile("unit.dyr", MACHINE + "101 'TGOV1' 1   0.05 0.3 1.0 0.0 2.0 7.0 0.0 /\n")
    found = titles(file.unit())
    assert found["governor_acting"] == "The governor TGOV1 of unit 1 did not act"
    assert found["governor_dead_band"] == "TGOV1 of unit 1: dead band of the speed"
    assert found["exciter"] == "The file of unit 1 has no exciter; one acted"
    assert found["stabiliser"] == "The file of unit 1 has no stabiliser; one acted"
    assert found["saturation"] == "The file of unit 1 has no saturation; its machine saturates"


def test_without_a_file_it_is_the_unit_and_a_device_of_its_own_keeps_the_titles_of_the_library():
    records = [Record(PARTS[name], {}) for name in ("GENROU", "SEXS", "PSS2A", "HYGOV")]
    found = titles(unit(records))
    assert found["stabiliser_acting"] == "The stabiliser PSS2A of the unit did not act"
    assert found["regulator_acting"] == "The voltage regulator SEXS of the unit did not act"
    assert titles(SYNCHRONOUS_MACHINE)["exciter"] == EFFECTS["exciter"].title


def test_every_title_can_be_told():
    """Each word that a title asks for belongs to a unit with one of its tags."""
    words = {"unit": "unit 1", **{part.slot: part.name for part in PARTS.values()}}
    for effect in EFFECTS.values():
        told = effect.in_words(words)
        assert "{" not in told.title
        assert (told.title == effect.title) == (not effect.told)


@pytest.mark.parametrize(
    ("share", "told"),
    [
        ((1.02, 0.98, 1.06), "did not act"),
        ((1.04, 1.03, 1.045), "did not act"),
        ((1.97, 1.9, 2.04), "acted with the wrong sign"),
        ((0.5, 0.45, 0.55), "acted with 0.5 of its action"),
    ],
)
def test_the_fitted_share_decides_the_words(share, told):
    effect = STABILISER_ACTING.in_words({"stabiliser": "IEEEST", "unit": "unit 1"})
    named = NamedEffect.of(effect, {"stabiliser_acting.a": share})
    assert named.title == f"The stabiliser IEEEST of unit 1 {told}"
    assert NamedEffect.of(effect).title == effect.title

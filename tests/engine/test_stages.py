import pytest

from errorscreen.engine import Call, Model
from errorscreen.engine.examples import decay
from errorscreen.exceptions import InputError


def model(**changes):
    parts = {
        "name": "lag",
        "inputs": ("u",),
        "states": ("x",),
        "constants": ("T",),
        "calls": (Call(decay, ("x", "u", "T"), ("d_x",)),),
        "outputs": ("x",),
    }
    return Model(**{**parts, **changes})


def test_a_missing_quantity_is_named_with_its_reader_and_the_nearest_match():
    with pytest.raises(
        InputError, match=r"'lag', read by decay: unknown quantity 'Tx' \(did you mean .*'T'.*: u, x, T"
    ):
        model(calls=(Call(decay, ("x", "u", "Tx"), ("d_x",)),))


def test_a_quantity_written_later_is_not_available_earlier():
    first = Call(decay, ("x", "late", "T"), ("d_x",))
    second = Call(decay, ("x", "u", "T"), ("late",))
    with pytest.raises(InputError, match="unknown quantity 'late'"):
        model(calls=(first, second))
    assert "late" in model(calls=(second, first)).signals


def test_a_state_without_derivative_is_refused():
    with pytest.raises(InputError, match="nothing writes d_y"):
        model(states=("x", "y"))


def test_an_unknown_output_is_refused():
    with pytest.raises(InputError, match="unknown quantity 'z'.*Allowed"):
        model(outputs=("z",))

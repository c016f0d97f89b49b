import numpy as np
import pytest

from errorscreen.exceptions import InputError
from errorscreen.power.elements import Branch, Generator, Load


def test_branch_matrix_follows_from_the_ideal_transformer():
    """An ideal transformer a : 1 in front of the Pi circuit: V1 = a V', I1 = I' / a*."""
    branch = Branch(1, 2, r=0.01, x=0.1, b=0.3, tap=1.05, shift=0.4)
    V1, V2 = 1.02 * np.exp(0.1j), 0.97 * np.exp(-0.2j)
    a = 1.05 * np.exp(0.4j)
    inner = V1 / a
    into = (inner - V2) / (0.01 + 0.1j) + inner * 0.15j
    I2 = (V2 - inner) / (0.01 + 0.1j) + V2 * 0.15j
    found = np.reshape(branch.admittances, (2, 2)) @ [V1, V2]
    assert np.allclose(found, [into / np.conj(a), I2], rtol=1e-14)


def test_a_shift_moves_the_angle_of_an_open_end():
    """The second end of an unloaded transformer has the voltage V1 / a."""
    y21, y22 = Branch(1, 2, r=0.0, x=0.1, tap=1.1, shift=0.5).admittances[2:]
    assert np.isclose(-y21 / y22, np.exp(-0.5j) / 1.1)


def test_a_branch_out_of_service_carries_nothing():
    assert Branch(1, 2, 0.0, 0.1, b=0.5, in_service=False).admittances == (0, 0, 0, 0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Branch(1, 2, 0.0, 0.0), "branch 1-2 .circuit 1.: r and x are both 0"),
        (lambda: Branch(1, 2, 0.0, np.nan), "branch 1-2 .circuit 1.: x is nan. Allowed: a number"),
        (lambda: Branch(1, 2, 0.0, 0.1, tap=0.0), "the ratio is 0. Allowed: a positive number"),
        (lambda: Branch(2, 2, 0.0, 0.1), "both ends are at the same bus"),
        (lambda: Load(3, np.inf), "load at bus 3: p is inf"),
        (lambda: Load(3, "1"), "load at bus 3: p is '1'"),
        (lambda: Generator(4, v=-1.0), "generator at bus 4: the voltage is -1.0. Allowed: a number > 0"),
        (lambda: Generator(4, v=1.0, q_min=1.0, q_max=0.0), "the reactive limits are 1.0 and 0.0"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(InputError, match=message):
        make()

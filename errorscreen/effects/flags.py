r"""Flags of a record that are set otherwise in the unit: its control is in another mode than the file says.

A flag f of the file is a choice of two. The effect takes the other one,

.. math:: f = 1 - f_0                                                                           \qquad (F1)

before the start, so the equilibrium follows. It is a switch: on or off, with no value to fit between.
"""

from __future__ import annotations

from typing import Any

from errorscreen.effects.base import Effect, value


def to_zero(on: Any) -> Any:
    """The flag where the file says 1, (F1)."""
    return (0.0 * on,)


def to_one(on: Any) -> Any:
    """The flag where the file says 0, (F1)."""
    return (0.0 * on + 1.0,)


def other_flag(model: str, flag: str, stated: float, description: str, source: str = "") -> Effect:
    """The other setting of a flag of a record.

    Parameters
    ----------
    model : str
        Name of the record, for example ``"REECA1"``.
    flag : str
        Its constant, which is 0 or 1.
    stated : float
        Value in the file.
    description : str
        Meaning of both settings.
    source : str

    Returns
    -------
    Effect
        A switch, ``"REECA1.QFLAG"``, that acts on the constant.

    Examples
    --------
    >>> other_flag("REECA1", "QFLAG", 1.0, "1: inner control of voltage").title
    'QFLAG of REECA1 is 0, the file says 1'
    """
    wanted = 0 if stated else 1
    return Effect(
        f"{model}.{flag}", f"{flag} of {model} is {wanted}, the file says {1 - wanted}", flag,
        to_one if wanted else to_zero,
        (value("on", 1.0, 0.0, 1.0, "", model, "on", "1: the other setting, 0: that of the file"),),
        kind="constants",
        switch=True,
        formula=f"{flag} = {wanted}",
        description=f"The control of the unit was in another mode than the file says: {flag} is {wanted} "
        f"({description}).",
        source=source or f"PSS/E model library, {model}",
        confused_with=("other gains of this control", "another flag of the unit"),
    )  # fmt: skip

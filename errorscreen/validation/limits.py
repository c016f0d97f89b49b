"""Limits that validation is judged by: profiles from public text, and the user's own with their source."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from errorscreen._runtime.registry import Registry
from errorscreen.validation.windows import IEC_BEGIN, IEC_END


@dataclass(frozen=True)
class WindowLimits:
    """Largest magnitudes in one window, in pu; None: no limit.

    Parameters
    ----------
    ME, MAE, MXE : float or None
        See `errorscreen.validation.WindowErrors`.
    """

    ME: float | None = None
    MAE: float | None = None
    MXE: float | None = None


@dataclass(frozen=True)
class Limits:
    """Limits of all windows, of step responses and of the recovery; None: no limit.

    Parameters
    ----------
    source : str
        Where they come from.
    set_by : str
        Who set them for this unit.
    windows : mapping of str to WindowLimits
        By ``"before"``, ``"during"`` and ``"after"``.
    begin, end : float
        Seconds that are left out after the beginning and the end of a fault.
    times : float or None
        Of reaction, rise and settling time: largest difference, as a part of the measured one.
    overshoot : float or None
        The same of the overshoot.
    steady : float or None
        Largest difference of the final level of a step, in pu.
    recovery : (float, float) or None
        Largest difference of the time until 90 % of P: a part of the measured one, and seconds; the smaller one counts.
    """

    source: str
    set_by: str = ""
    windows: Mapping[str, WindowLimits] = field(default_factory=dict)
    begin: float = IEC_BEGIN
    end: float = IEC_END
    times: float | None = None
    overshoot: float | None = None
    steady: float | None = None
    recovery: tuple[float, float] | None = None


@dataclass(frozen=True)
class Profile:
    """Limits that are public text.

    Parameters
    ----------
    name : str
        For case files.
    title : str
        For reports.
    limits : Limits
    """

    name: str
    title: str
    limits: Limits


def _profile(
    name: str, title: str, fiche: str, outside: tuple[float, ...], during: tuple[float, ...]
) -> Profile:
    around, inside = (WindowLimits(MXE=mxe, ME=me, MAE=mae) for mxe, me, mae in (outside, during))
    limits = Limits(
        f"RTE, Documentation technique de référence, fiche {fiche}, as DyCoV states it",
        windows={"before": around, "during": inside, "after": around},
        begin=0.020,
        end=0.060,
        times=0.10,
        overshoot=0.15,
        steady=0.01,
        recovery=(0.10, 0.100),
    )
    return Profile(name, title, limits)


#: built-in profiles, and those of other packages (group ``errorscreen.profiles``)
PROFILES: Registry[Profile] = Registry(
    "profile of limits",
    "errorscreen.profiles",
    Profile,
    {
        one.name: one
        for one in (
            _profile(
                "rte-simulation", "RTE, against a simulation", "I16", (0.05, 0.02, 0.03), (0.08, 0.05, 0.07)
            ),
            _profile(
                "rte-measurement",
                "RTE, against a field measurement",
                "F16",
                (0.08, 0.04, 0.07),
                (0.10, 0.05, 0.08),
            ),
            _profile(
                "rte-tracking-simulation",
                "RTE, set-point tracking in simulation",
                "I16",
                (0.05, 0.02, 0.03),
                (0.08, 0.05, 0.07),
            ),
            _profile(
                "rte-tracking-site",
                "RTE, set-point tracking in a site test",
                "F16",
                (0.05, 0.03, 0.04),
                (0.10, 0.05, 0.07),
            ),
        )
    },
)

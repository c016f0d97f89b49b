"""The short answer: what is wrong, where, and whether parameters can explain it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from errorscreen.discovery.finder import CauseFinder
from errorscreen.discovery.judge.errors import ChannelFit, StageError, channel_fits, stage_errors
from errorscreen.discovery.judge.residual_test import ResidualTest
from errorscreen.discovery.judge.verdict import Verdict
from errorscreen.discovery.unknown_input.locations import InputLocation
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import as_observations


@dataclass(frozen=True)
class Diagnosis:
    """What a simulation gets wrong.

    Parameters
    ----------
    verdict : Verdict
        ``"within-noise"``, ``"parameters"`` or ``"unknown"``.
    fits : tuple of ChannelFit
        How well each channel of each recording is reproduced at the nominal parameters.
    stages : tuple of StageError
        Where in time those errors lie.
    remainder : ResidualTest
        What calibrated parameters leave, in cells of channel, stage and frequency band.
    places : tuple of InputLocation
        Where an unknown signal would explain that, the most probable first; empty unless the verdict is unknown.
    calibrated : Simulator
        With the parameters that fit best as its nominal values.
    """

    verdict: Verdict
    fits: tuple[ChannelFit, ...]
    stages: tuple[StageError, ...]
    remainder: ResidualTest
    places: tuple[InputLocation, ...]
    calibrated: Simulator


def diagnose(
    simulator: Simulator,
    recordings: Any,
    *,
    significance: float = 0.002,
    n_starts: int = 4,
    library_size: int = 2048,
    random_state: Any = None,
    report: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Say what a simulation gets wrong, where, and whether its parameters can explain it.

    All parameters are calibrated together and led to rest; what they leave is tested against noise (`residual_test`).
    No effect is tried; that is what `CauseFinder` does.

    Parameters
    ----------
    simulator : Simulator
    recordings : Observation, or anything ``simulator.observe`` takes, or a list of them
    significance : float
        See `CauseFinder`.
    n_starts, library_size : int
        Of the calibration, see `MAPCalibrator`.
    random_state : None, int, SeedSequence, Generator or RandomState
    report : callable, optional
        Takes lines of text while it works.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        If an argument or a recording cannot be used.
    SimulationError
        If nothing can be simulated.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, held_out, truth = demo_recordings(0)
    >>> found = diagnose(PlantSimulator("synchronous_machine", recording), recording, random_state=0)
    >>> found.verdict.kind
    'parameters'
    """
    finder = CauseFinder(
        simulator,
        max_effects=0,
        significance=significance,
        n_starts=n_starts,
        library_size=library_size,
        random_state=random_state,
        report=report,
    ).fit(recordings)
    seen = [(o, simulator.baseline(o.event)) for o in as_observations(simulator, recordings)]
    return Diagnosis(
        finder.verdict_,
        tuple(fit for o, y in seen for fit in channel_fits(o, y)),
        tuple(stage for o, y in seen for stage in stage_errors(o, y)),
        finder.residual_tests_["parameters"],
        tuple(finder.input_locations_),
        finder.recalibrated_simulator_,
    )

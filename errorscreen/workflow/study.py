"""The main job: screen, calibrate, judge, for one recording and others to judge on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import errorscreen
from errorscreen.cases import Case
from errorscreen.cases.case_models import CalibrationSection, DiscoverySection, RunSection, ScreeningSection
from errorscreen.checkpoint import digest
from errorscreen.discovery import ChannelFit, StageError, Verdict
from errorscreen.exceptions import InputError
from errorscreen.generation import local_sensitivity
from errorscreen.observations import Observation
from errorscreen.recordings import Recording
from errorscreen.resampling import check_steps
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.base import Simulator
from errorscreen.workflow.grid_recordings import observed_grid
from errorscreen.workflow.screen import Screened


@dataclass(frozen=True)
class Study:
    """What to compare with what, and how.

    Parameters
    ----------
    title : str
    simulator : Simulator
    observation : Observation
        The recording that is fitted.
    held_out : tuple of Observation
        Recordings that are only judged on.
    base_mva, f_nominal : float
        What 1 pu of P and Q is, and the nominal frequency in Hz.
    screening, calibration, discovery, run
        Sections of a case file.
    truth : mapping of str to float, optional
        Hidden parameters, where they are known (the demo).
    paths : tuple of str
        Files of the recordings, the fitted one first; empty where there are none.
    """

    title: str
    simulator: Simulator
    observation: Observation
    held_out: tuple[Observation, ...]
    base_mva: float
    f_nominal: float
    screening: ScreeningSection
    calibration: CalibrationSection
    discovery: DiscoverySection
    run: RunSection
    truth: Mapping[str, float] | None = None
    paths: tuple[str, ...] = ()

    @classmethod
    def from_case(cls, case: Case) -> Study:
        """Read the recordings of a case file and set up its simulator.

        Raises
        ------
        InputError
            If a recording cannot be used, or lacks what the device needs.
        """
        recording, held_out = case.load_recording(), case.load_held_out()
        for one in (recording, *held_out):
            for key in ("step", "dt"):
                seconds = getattr(case.simulation, key)
                if seconds is not None:
                    where = f"recording {one.name!r}, simulation.{key}"
                    check_steps(one.time[-1] - one.time[0], seconds, where)
        if case.grid is not None:
            case.check_events()
            grid, observed = observed_grid(case, case.grid, (recording, *held_out))
            study = cls.of(case.title, grid, recording, observed[1:], case)
            study = replace(study, observation=observed[0])
        else:
            assert case.device is not None  # `load_case` sees to that
            plant = PlantSimulator(
                case.device.type,
                recording,
                parameters=case.parameters(),
                constants=case.device.constants,
                step=case.simulation.step,
                dt=case.simulation.dt,
                grid_impedance=case.device.grid_impedance,
            )
            study = cls.of(case.title, plant, recording, held_out, case)
        return replace(study, paths=tuple(section.path for section in (case.recording, *case.held_out)))

    @classmethod
    def of(
        cls,
        title: str,
        simulator: Simulator,
        recording: Recording,
        held_out: tuple[Recording | Observation, ...],
        sections: Any,
        truth: Mapping[str, float] | None = None,
    ) -> Study:
        """Study of recordings that are at hand; `sections` has screening, calibration, discovery and run.

        Raises
        ------
        InputError
            If a recording lacks what the simulator needs, or two hold the same readings.
        """
        observation, *others = (simulator.observe(r) for r in (recording, *held_out))
        _check_distinct([observation, *others])
        return cls(
            title or recording.name,
            simulator,
            observation,
            tuple(others),
            recording.base_mva,
            recording.f_nominal,
            sections.screening,
            sections.calibration,
            sections.discovery,
            sections.run,
            truth,
        )

    def fingerprint(self) -> str:
        """Digest of everything the result depends on."""
        return digest(
            errorscreen.__version__,
            [(p.name, p.nominal, p.lower, p.upper, p.scale) for p in self.simulator.parameters],
            repr(self.simulator),
            self.simulator.settings(),
            self.observation,
            list(self.held_out),
            [
                s.model_dump(exclude={"n_jobs", "out"})
                for s in (self.screening, self.calibration, self.discovery, self.run)
            ],
        )


@dataclass(frozen=True)
class Calibrated:
    """Result of one calibration.

    Parameters
    ----------
    method : str
        ``"map"`` or ``"pso"``.
    selection : str
        ``"all"``, or the screener whose selection was calibrated.
    names : tuple of str
        Calibrated parameters.
    theta : ndarray of shape (m,)
        All parameters afterwards.
    responses : tuple of ndarray of shape (R, L)
        For the fitted recording and each held-out one.
    fits, stages : tuple of list
        `ChannelFit` and `StageError` of each recording, the fitted one first.
    arrays, meta : dict
        What the calibrator said besides: intervals, flags, groups, counts, seconds.
    """

    method: str
    selection: str
    names: tuple[str, ...]
    theta: NDArray[np.float64]
    responses: tuple[NDArray[np.float64], ...]
    fits: tuple[list[ChannelFit], ...]
    stages: tuple[list[StageError], ...]
    arrays: dict[str, Any]
    meta: dict[str, Any]

    @property
    def label(self) -> str:
        """For tables and legends."""
        return f"{self.method} on {self.selection}"


@dataclass(frozen=True)
class Discovered:
    """Result of the search for causes.

    Parameters
    ----------
    label : str
        Effects that were added, empty for none.
    responses : tuple of ndarray of shape (R, L)
        Of the extended model, for the fitted recording and each held-out one.
    fits : tuple of list
        `ChannelFit` of each recording.
    waveforms : tuple of ndarray of shape (2, L)
        Time and unknown signal at each place that was ranked.
    meta : dict
        See `discover_causes`.
    """

    label: str
    responses: tuple[NDArray[np.float64], ...]
    fits: tuple[list[ChannelFit], ...]
    waveforms: tuple[NDArray[np.float64], ...]
    meta: dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """Everything a report tells about a study.

    Parameters
    ----------
    study : Study
    before : tuple of ndarray of shape (R, L)
        Responses at the nominal parameters, for the fitted recording and each held-out one.
    fits, stages : tuple of list
        `ChannelFit` and `StageError` of `before`, for each recording.
    screened : list of Screened
    calibrated : list of Calibrated
    discovered : Discovered or None
        None where causes were not searched.
    verdict : Verdict
    seconds : float
        Of this run.
    started : str
        ISO 8601.
    reused : list of str
        Stages that were taken over from an earlier run.
    """

    study: Study
    before: tuple[NDArray[np.float64], ...]
    fits: tuple[list[ChannelFit], ...]
    stages: tuple[list[StageError], ...]
    screened: list[Screened]
    calibrated: list[Calibrated]
    discovered: Discovered | None
    verdict: Verdict
    seconds: float
    started: str
    reused: list[str]

    @property
    def true_contributions(self) -> NDArray[np.float64] | None:
        """Contributions (14) at the true parameters, shape (m,), where those are known."""
        if self.study.truth is None:
            return None
        simulator = self.study.simulator
        theta = np.array([self.study.truth[name] for name in simulator.parameters.names])
        sensitivity = local_sensitivity(simulator, theta, self.study.observation.event).values[0]
        return simulator.parameters.deviation(theta)[0] * sensitivity

    @property
    def best(self) -> Calibrated:
        """The calibration that the report judges by: the first of the methods asked for."""
        return self.calibrated[0]

    @property
    def observations(self) -> tuple[Observation, ...]:
        """The fitted recording, then the others."""
        return (self.study.observation, *self.study.held_out)


def _check_distinct(observations: list[Observation]) -> None:
    """Refuse a recording to judge on that was fitted, or that counts twice: the gain would be flattered."""
    seen: dict[str, str] = {}
    for observation in observations:
        name, key = observation.event.name, digest(observation.values)
        if key in seen:
            raise InputError(
                f"it holds the same readings as {seen[key]!r}",
                where=f"recording {name!r}",
                allowed="another event in each recording",
                remedy="Judge on recordings that are not fitted, or leave this one out",
            )
        seen[key] = name

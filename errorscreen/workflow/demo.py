"""The study of the embedded example."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

from errorscreen.cases import load_case
from errorscreen.cases.demo_unit import write_demo_case
from errorscreen.discovery.readings import ranked_readings
from errorscreen.simulators import PlantSimulator
from errorscreen.workflow.study import Study
from errorscreen.workflow.suspect_readings import doubts

_log = logging.getLogger(__name__)


def demo_study(seed: int, folder: str | Path, discovery: bool = True) -> Study:
    """Write the files of the example, turn the channel that is recorded with the wrong polarity, and set up the study.

    Parameters
    ----------
    seed : int
        Of what is hidden, and of the noise.
    folder : str or Path
        For ``unit.dyr``, the recordings and ``case.toml``; made where it is missing.
    discovery : bool
        Whether causes are searched.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_demo_case(folder, seed, discovery=discovery)
    case = load_case(folder / "case.toml")
    study = Study.from_case(case)
    suspects = doubts(study.observations)
    if not suspects or not isinstance(study.simulator, PlantSimulator):
        return study
    _log.info("suspect reading: %s", suspects[0])
    _, found = ranked_readings(study.simulator, case.load_recording())
    if not found:
        return study
    reading = found[0][1]
    _log.info("the demo goes on with %s in case.toml", reading.words)
    keys = {name: dict(changed) for name, changed in reading.keys.items()}
    write_demo_case(folder, seed, keys=keys, discovery=discovery)
    study = Study.from_case(load_case(folder / "case.toml"))
    return replace(study, title=f"{study.title}, polarity of {' and '.join(keys)} corrected")

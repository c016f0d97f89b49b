"""Parts of units left out, in simulations by another program, ANDES 2.0: renews a table of ``docs/studies``.

``python benchmarks/andes_units.py --make FOLDER``, with ANDES, simulates the units; ``--check FOLDER`` compares the whole
units with it, and ``--search FOLDER [CASE ...]`` leaves their last parts out and looks for the causes, a line of
``FOLDER/results.jsonl`` for each search. Both take errorscreen, and ``--table FOLDER`` makes the table of the lines.
"""

import argparse
import csv
import json
from pathlib import Path
from time import perf_counter

#: values that differ from typical ones, by names of errorscreen. D is larger in ANDES by the mechanical power, because
#: it takes that as a torque. HYGOV of ANDES leaves r Tr out, so that it is 1 here.
RECORDS = {
    "GENROU": {"Tpdo": 6.5, "Tppdo": 0.035, "Tpqo": 0.6, "D": 1.5, "Xpq": 0.55, "Xpp": 0.25},
    "SEXS": {},
    "TGOV1": {"VMAX": 1.2},
    "HYGOV": {"r": 0.4, "Tr": 2.5, "VELM": 0.5, "Dturb": 0.0, "TW": 1.2},
    "IEEEG1": {"K1": 0.3, "K3": 0.4, "K5": 0.3, "T7": 0.05},
    "ESST4B": {"VRMAX": 3.0, "VRMIN": -3.0, "VMMAX": 3.0, "VMMIN": -3.0},
    "IEEEST": {"A1": 0.02, "A2": 0.0004, "T1": 0.15, "T2": 0.03, "T3": 0.15, "T4": 0.03, "KS": 10.0},
}
CASES = {
    "sexs": ("GENROU", "SEXS"),
    "tgov1": ("GENROU", "TGOV1"),
    "hygov": ("GENROU", "HYGOV"),
    "ieeeg1": ("GENROU", "IEEEG1"),
    "esst4b": ("GENROU", "ESST4B"),
    "sexs_ieeest": ("GENROU", "SEXS", "IEEEST"),
    "sexs_tgov1_ieeest": ("GENROU", "SEXS", "TGOV1", "IEEEST"),
}
COLUMNS = ("time", "V", "angle", "P", "Q")
#: instants in s: between two samples
FAULT, CLEARING, END = 1.0 + 1 / 240, 1.1 + 1 / 240, 12.0
STEP, SAMPLE = 1 / 960, 1 / 120
#: signal to noise in dB
SNR = 40.0


def values_of(model):
    """Complete record of a model, in its order, from its defaults in the package."""
    from errorscreen.models.dyr_record import known_parts

    part = known_parts()[model]
    return {**part.typical, **RECORDS[model]}


def dyr_text(models):
    """Records of a unit as a DYR file."""
    lines = []
    for model in models:
        numbers = " ".join(f"{value:g}" for value in values_of(model).values())
        lines.append(f"1 '{model}' 1  {numbers} /")
    return "\n".join(lines) + "\n"

#!/usr/bin/env bash
# andes 2.0.0: of a transformer in a RAW file whose ratios are in pu (CW = 1) the ratio of the second winding has no effect.
#
# Guess: ratios of 1.0 and 1.05 pu are the same transformer as 20 and 144.9 kV at buses of 20 and 138 kV (CW = 2): an
#        off-nominal ratio of 1.0 / 1.05 = 0.952, so the load sees about 1.07 pu.
# Seen:  in kV the ratio is 0.952 and the voltage at the load 1.065 pu; in pu the ratio is 1 and the voltage 1.014 pu,
#        without a message. Two windings in pu with 0.95 and 1.05 become 0.95.
#
# The script solves the power flow of one system three times; only the codes and ratios of the transformer differ.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check andes==2.0.0
cd "$folder"
cat > run.py <<'PYTHON'
from pathlib import Path

import andes

CASE = """0, 100.0, 33, 0, 1, 60.0 / case
one generator
one transformer
1,'UNIT        ', 20.0,3,1,1,1,1.02,0.0,1.1,0.9,1.1,0.9
2,'LOAD        ',138.0,1,1,1,1,1.0,0.0,1.1,0.9,1.1,0.9
0 / END OF BUS DATA, BEGIN LOAD DATA
2,'1 ',1,1,1,50.0,10.0,0.0,0.0,0.0,0.0,1,1,0
0 / END OF LOAD DATA, BEGIN FIXED SHUNT DATA
0 / END OF FIXED SHUNT DATA, BEGIN GENERATOR DATA
1,'1 ',50.0,10.0,99.0,-99.0,1.02,0,200.0,0.0,0.25,0.0,0.0,1.0,1,100.0,200.0,0.0,1,1.0
0 / END OF GENERATOR DATA, BEGIN BRANCH DATA
0 / END OF BRANCH DATA, BEGIN TRANSFORMER DATA
1,2,0,'1 ',{code},1,1,0.0,0.0,2,'T1',1,1,1.0
0.0,0.06,100.0
{first},0.0,0.0,250.0,250.0,250.0,0,0,1.1,0.9,1.1,0.9,33,0,0.0,0.0
{second},0.0
0 / END OF TRANSFORMER DATA, BEGIN AREA DATA
0 / END OF AREA DATA
Q
"""


def solved(code, first, second):
    Path("case.raw").write_text(CASE.format(code=code, first=first, second=second))
    system = andes.load("case.raw", no_output=True, default_config=True)
    assert system.PFlow.run()
    return round(float(system.Line.tap.v[0]), 4), round(float(system.Bus.v.v[1]), 4)


andes.config_logger(stream_level=50)
kilovolt, per_unit, both = solved(2, 20.0, 144.9), solved(1, 1.0, 1.05), solved(1, 0.95, 1.05)
print(f"20 and 144.9 kV: ratio {kilovolt[0]}, load at {kilovolt[1]} pu")
print(f"1.0 and 1.05 pu: ratio {per_unit[0]}, load at {per_unit[1]} pu")
print(f"0.95 and 1.05 pu: ratio {both[0]}, load at {both[1]} pu")
assert kilovolt == (0.9524, 1.065), kilovolt
assert per_unit == (1.0, 1.0137), per_unit
assert both[0] == 0.95, both
PYTHON
venv/bin/python run.py

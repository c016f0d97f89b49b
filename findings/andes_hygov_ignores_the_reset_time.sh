#!/usr/bin/env bash
# andes 2.0.0: the reset time Tr of the hydro governor HYGOV has no influence on a simulation.
#
# Guess: Tr sets how fast the temporary droop fades, so the gate after a fault differs between Tr = 1 s and Tr = 20 s. In the
#        block diagram of the PSS/E model the gate is (1 + s Tr) / (s r Tr) of the filtered error.
# Seen:  the gate position is the same to the last digit for 1, 5 and 20 s. The integral of the error is taken without the
#        factor 1 / (r Tr); the value of Tr is read, and used nowhere. The temporary droop r acts on the proportional part.
#
# The script runs one system with a fault of 100 ms three times, with another Tr in its DYR file each time.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check andes==2.0.0
cd "$folder"
cat > system.raw <<'RAW'
0,   100.00, 33, 0, 0, 50.00     / case
one machine
two buses
1,'GRID        ', 138.0000,3,   1,   1,   1,1.00000,   0.0000,1.10000,0.90000,1.10000,0.90000
2,'UNIT        ', 138.0000,2,   1,   1,   1,1.00000,   0.0000,1.10000,0.90000,1.10000,0.90000
0 / END OF BUS DATA, BEGIN LOAD DATA
0 / END OF LOAD DATA, BEGIN FIXED SHUNT DATA
0 / END OF FIXED SHUNT DATA, BEGIN GENERATOR DATA
1,'1 ',   0.0,  0.0,   100.000,  -100.000,1.00000,     0,   100.000, 0.00000E+0, 2.00000E-1, 0.00000E+0, 0.00000E+0,1.00000,1,  100.0,   318.000,     0.000,   1,1.0000
2,'1 ',   50.0,  0.0,   100.000,  -100.000,1.00000,     0,   100.000, 0.00000E+0, 2.500E-1, 0.00000E+0, 0.00000E+0,1.00000,1,  100.0,   318.000,     0.000,   1,1.0000
0 / END OF GENERATOR DATA, BEGIN BRANCH DATA
1,   2,'1 ', 1.00000E-2, 1.20000E-1,   0.00000,  250.00,  250.00,  250.00,  0.00000,  0.00000,  0.00000,  0.00000,1,1,   0.00,   1,1.0000
0 / END OF BRANCH DATA, BEGIN TRANSFORMER DATA
0 / END OF TRANSFORMER DATA, BEGIN AREA DATA
Q
RAW
cat > run.py <<'PYTHON'
from pathlib import Path

import andes
import numpy as np

MACHINE = "'GENROU' 1 6.0 0.04 0.8 0.06 {H} 2.0 1.8 1.7 0.3 0.5 0.22 0.15 0.0 0.0 /\n"


def gate(Tr):
    Path("unit.dyr").write_text(
        "1 " + MACHINE.format(H=400.0) + "2 " + MACHINE.format(H=4.0)
        + f"2 'HYGOV' 1 0.05 0.5 {Tr} 0.05 0.5 0.2 1.0 0.0 1.0 1.2 0.0 0.08 /\n"
    )
    system = andes.load("system.raw", addfile="unit.dyr", setup=False, no_output=True, default_config=True)
    system.add("Fault", {"bus": 2, "tf": 1.0, "tc": 1.1, "xf": 0.05})
    system.setup()
    assert system.PFlow.run()
    for name, value in {"tf": 10, "fixt": 1, "tstep": 0.005, "no_tqdm": 1}.items():
        setattr(system.TDS.config, name, value)
    system.TDS.run()
    assert system.HYGOV.Tr.v[0] == Tr, "the value is read"
    return np.array(system.dae.ts.x[:, system.HYGOV.gtpos.a[0]])


andes.config_logger(stream_level=50)
gates = {Tr: gate(Tr) for Tr in (1.0, 5.0, 20.0)}
for Tr, row in gates.items():
    print(f"Tr = {Tr:4.1f} s: gate {row[0]:.12f} at the start, {row[-1]:.12f} at 10 s, range {np.ptp(row):.3e}")
assert np.ptp(gates[1.0]) > 1e-4, "the gate moves"
assert all(np.array_equal(row, gates[1.0]) for row in gates.values())
print("as described: Tr changes nothing")
PYTHON
"$folder/venv/bin/python" run.py 2> /dev/null

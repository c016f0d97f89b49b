#!/usr/bin/env bash
# andes 2.0.0: numbers of a PSS/E DYR file with the Fortran exponent D (1.0D1, 2.0D2) stay text in the model.
#
# Guess: a DYR reader takes 1.0D1 for 10, as Fortran programs that write such files do, or refuses the record.
# Seen:  the load succeeds. K and TB of SEXS hold the strings '2.0D2' and '1.0D1', while the numbers beside them, and the
#        same numbers written as 200.0 and 10.0, are floats. Nothing is logged at the level of warnings.
#
# The script loads one system twice, with both spellings of the same two numbers.
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
cat > read.py <<'PYTHON'
import logging
from pathlib import Path

import andes

MACHINE = "2 'GENROU' 1 6.0 0.04 0.8 0.06 4.0 0.0 1.8 1.7 0.3 0.5 0.22 0.15 0.1 0.4 /\n"


class Heard(logging.Handler):
    messages = []

    def emit(self, record):
        if record.levelno >= logging.WARNING:
            self.messages.append(record.getMessage())


def exciter(TB, K):
    Path("unit.dyr").write_text(f"{MACHINE}2 'SEXS' 1 0.1 {TB} {K} 0.05 0.0 4.0 /\n")
    system = andes.load("system.raw", addfile="unit.dyr", setup=False, no_output=True, default_config=True)
    return system.SEXS.TB.v[0], system.SEXS.K.v[0], system.SEXS.TE.v[0]


andes.config_logger(stream_level=50)
logging.getLogger("andes").addHandler(Heard())
plain, fortran = exciter("10.0", "200.0"), exciter("1.0D1", "2.0D2")
print("plain:  ", plain)
print("Fortran:", fortran)
told = [message for message in Heard.messages if "D1" in message or "D2" in message]
print("warnings about them:", told)
assert plain == (10.0, 200.0, 0.05), plain
assert fortran == ("1.0D1", "2.0D2", 0.05), fortran
assert not told
print("as described: the numbers stay text, and nothing is said")
PYTHON
"$folder/venv/bin/python" read.py 2> /dev/null

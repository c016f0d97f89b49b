#!/usr/bin/env bash
# comtrade 0.2.0: a missing sample of a FLOAT32 record stays a number, -3.4e38, while those of the other types become NaN.
#
# Guess: the mark of a missing sample, the negative number of the largest size in single precision (FF7FFFFF hex; IEEE
#        C37.111-2013, data of type FLOAT32), becomes NaN, as 8000 hex in BINARY and 80000000 hex in BINARY32 do.
# Seen:  BINARY and BINARY32 give NaN. FLOAT32 gives -3.4028235e+38, without a message. The library compares with the
#        smallest positive number of double precision, which no number of single precision is equal to.
#
# The script writes one channel of five samples, the third of which is missing, in each of the three types.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check comtrade==0.2.0
cd "$folder"
cat > read.py <<'PYTHON'
import math
import struct
import warnings
from pathlib import Path

import comtrade

MARKS = {"BINARY": ("h", -(2**15)), "BINARY32": ("i", -(2**31)), "FLOAT32": ("f", struct.unpack("<f", b"\xff\xff\x7f\xff")[0])}


def third(kind):
    code, mark = MARKS[kind]
    lines = ["PLANT,DFR,2013", "1,1A,0D", "1,VA,A,UNIT1,kV,1,0,0,-32767,32767,20,0.1,P", "50", "1", "1000,5"]
    lines += ["03/05/2026,10:00:00.000000", "03/05/2026,10:00:00.002000", kind, "1", "+0h00,+0h00", "0,0"]
    Path("a.cfg").write_text("\r\n".join(lines) + "\r\n")
    values = [1, 2, mark, 4, 5]
    rows = (struct.pack(f"<II{code}", k + 1, 1000 * k, value) for k, value in enumerate(values))
    Path("a.dat").write_bytes(b"".join(rows))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        record = comtrade.load("a.cfg", "a.dat", use_double_precision=True)
    assert record.total_samples == 5 and list(record.analog[0])[3:] == [4, 5]
    return record.analog[0][2], [str(one.message) for one in told]


found = {kind: third(kind) for kind in MARKS}
for kind, (value, told) in found.items():
    print(kind, value, told)
assert math.isnan(found["BINARY"][0]) and math.isnan(found["BINARY32"][0]), found
assert found["FLOAT32"][0] < -3.4e38, found
assert not any(told for _, told in found.values()), found
print("as described: the mark of a gap stays a number in FLOAT32")
PYTHON
"$folder/venv/bin/python" read.py

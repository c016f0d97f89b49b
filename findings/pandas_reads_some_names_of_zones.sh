#!/usr/bin/env bash
# pandas 3.1.1: %Z of to_datetime reads EST as UTC-05:00 for all of the year, and makes CST a gap.
#
# Guess: the names of the zones of North America are read alike, or all are refused, because they are not unique.
# Seen:  EST and MST are offsets, CST and PST are NaT. A file in which the name changes is read in part.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pandas==3.1.1
"$folder/venv/bin/python" - <<'PYTHON'
import pandas as pd

found = {}
for zone in ("EST", "CST", "MST", "PST", "UTC"):
    text = pd.Series([f"2026-05-03 10:00:00 {zone}"])
    found[zone] = pd.to_datetime(text, format="%Y-%m-%d %H:%M:%S %Z", utc=True, errors="coerce")[0]
    print(zone, found[zone])
assert (found["EST"].hour, found["MST"].hour, found["UTC"].hour) == (15, 17, 10), found
assert pd.isna(found["CST"]) and pd.isna(found["PST"]), found
print("as described: EST and MST are read, CST and PST are gaps")
PYTHON

#!/usr/bin/env bash
# pandas 3.1.1: to_datetime(..., format="ISO8601") takes the words "now" and "today" for dates.
#
# Guess: with format="ISO8601" and errors="coerce" a text that is not of ISO 8601 becomes NaT, as "yesterday" does.
# Seen:  "now" and "today" become the instant of the call, so a column of texts with such a word gives other time stamps at
#        each run, and no error.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pandas==3.1.1
"$folder/venv/bin/python" - <<'PYTHON'
import pandas as pd

texts = pd.Series(["2026-05-03T10:00:00", "yesterday", "now", "today"])
found = pd.to_datetime(texts, format="ISO8601", errors="coerce")
print(found)
gaps = [row for row in range(4) if pd.isna(found[row])]
assert gaps == [1], gaps
print("as described: only 'yesterday' is a gap")
PYTHON

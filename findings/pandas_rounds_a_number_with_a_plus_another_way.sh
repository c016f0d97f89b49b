#!/usr/bin/env bash
# pandas 3.1.1: to_numeric rounds a text with a leading plus another way than the same text without it.
#
# Guess: "+90071992.91015625" and "90071992.91015625" are the same number, as float() of Python has it.
# Seen:  with the plus the last bit differs, so equal readings of two exports, one of which writes signs, are not equal.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pandas==3.1.1
"$folder/venv/bin/python" - <<'PYTHON'
import pandas as pd

plain, signed = (pd.to_numeric(pd.Series([text]))[0] for text in ("90071992.91015625", "+90071992.91015625"))
print(repr(plain), repr(signed))
assert float("90071992.91015625") == float("+90071992.91015625") == plain
assert signed != plain
print("as described: the plus changes the last bit")
PYTHON

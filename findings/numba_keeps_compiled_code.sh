#!/usr/bin/env bash
# numba 0.68.1 (llvmlite 0.50.0): memory of a compiled function does not come back when the function is deleted.
#
# Guess: a generated module that was compiled with @njit and then dropped (dispatcher, module and sys.modules entry
#        deleted, garbage collected) gives its memory back, as a Python module does.
# Seen:  it does not. Of what compiling such modules adds to the process, more than half stays for good, so a service that
#        compiles one model a request grows without bound. Reading the same machine code from numba's own file cache adds
#        a small part of it.
#
# The script compiles six generated functions in one process, deletes each, and compares the growth with that of a second
# process that reads them from the cache.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numba==0.68.1 llvmlite==0.50.0 numpy==2.4.6 psutil==7.2.2
cat > "$folder/grow.py" <<'PYTHON'
import gc
import importlib
import sys
from pathlib import Path

import numba
import numpy as np
import psutil

FOLDER = Path(sys.argv[1])
LINE = "    y[{k}] = np.sin(x[{j}]) * np.exp(-x[{k}]) + np.sqrt(np.abs(y[{j}]) + {k}.5) / (1.0 + x[{k}] ** 2)"


def megabytes():
    gc.collect()
    return psutil.Process().memory_info().rss / 2**20


def module(number):
    path = FOLDER / f"generated_{number}.py"
    if not path.exists():
        body = "\n".join(LINE.format(k=k, j=(7 * k + number) % 300) for k in range(300))
        path.write_text(
            "import numba\nimport numpy as np\n\n\n"
            '@numba.njit("void(float64[::1], float64[::1])", cache=True)\n'
            f"def step(x, y):\n{body}\n"
        )
    return importlib.import_module(path.stem)


sys.path.insert(0, str(FOLDER))
numba.njit("float64(float64)")(lambda x: np.sin(x) + 1.0)(0.0)  # what numba needs for itself
before = megabytes()
for number in range(6):
    found = module(number)
    found.step(np.zeros(300), np.zeros(300))
    del sys.modules[found.__name__], found
print(f"{megabytes() - before:.1f}")
PYTHON
compiled=$("$folder/venv/bin/python" "$folder/grow.py" "$folder")
cached=$("$folder/venv/bin/python" "$folder/grow.py" "$folder")
echo "kept after deleting six compiled modules: $compiled MB; the same read from the file cache: $cached MB"
awk -v a="$compiled" -v b="$cached" 'BEGIN { exit !(a > 20 && b < 0.5 * a) }' || {
  echo "numba gives the memory back now, or its cache takes as much: the behaviour has changed" >&2
  exit 1
}

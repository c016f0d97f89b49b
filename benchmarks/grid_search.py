"""Search settings on the 39-bus system and renew what the documentation shows: ``python benchmarks/grid_search.py``."""

import runpy
import sys
from pathlib import Path

from errorscreen._runtime.persistence import write_text_atomic

ROOT = Path(__file__).resolve().parents[1]
EXAMPLE = ROOT / "examples" / "plot_ieee39_grid_search.py"
SAMPLES = "2500"

if __name__ == "__main__":
    sys.argv = [str(EXAMPLE), SAMPLES]
    found = runpy.run_path(str(EXAMPLE))
    note = f"{len(found['data'])} samples, noise 40 dB, {found['epochs']} epochs, three folds.\n"
    write_text_atomic(ROOT / "docs" / "tables" / "grid_search.md", f"{found['table']}\n{note}")

"""Measure speed and renew what the documentation shows of it: ``python benchmarks/speed.py [OUT]``."""

import shutil
import sys
from pathlib import Path

from errorscreen.bench import measure_speed

DOCS = Path(__file__).resolve().parents[1] / "docs"

if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "errorscreen-bench")
    measure_speed(out)
    shutil.copy(out / "table.md", DOCS / "tables" / "speed.md")
    shutil.copy(out / "labels.png", DOCS / "images" / "labels.png")

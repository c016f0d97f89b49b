"""Measure speed and renew table and figure of it in the docs: ``python benchmarks/speed.py [OUT]``."""

import logging
import shutil
import sys
from pathlib import Path

from errorscreen.bench import measure_speed

DOCS = Path(__file__).resolve().parents[1] / "docs"

if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "errorscreen-bench")
    measure_speed(out)
    shutil.copy(out / "table.md", DOCS / "tables" / "speed.md")
    shutil.copy(out / "labels.png", DOCS / "images" / "labels.png")

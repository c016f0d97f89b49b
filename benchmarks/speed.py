"""Measure speed and renew the table of the documentation: ``python benchmarks/speed.py [OUT]``."""

import shutil
import sys
from pathlib import Path

from errorscreen.bench import speed

TABLE = Path(__file__).resolve().parents[1] / "docs" / "tables" / "speed.md"

if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "errorscreen-bench")
    speed(out)
    TABLE.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(out / "table.md", TABLE)

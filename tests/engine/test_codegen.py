"""Generated modules and the fingerprints that decide whether stored machine code is used."""

import importlib
import linecache
import sys

from errorscreen.engine.codegen import fingerprint, source
from errorscreen.engine.stages import Call, Model


def test_an_edited_function_that_equations_call_gives_other_machine_code(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # else the second text might be taken for the first
    (tmp_path / "own_equations.py").write_text(
        "from own_blocks import block\n\n\ndef slope(x, T):\n    return (block(x, T),)\n"
    )
    prints = []
    for body in ("-x / T", "-2.0 * x / T"):
        (tmp_path / "own_blocks.py").write_text(f"def block(x, T):\n    return {body}\n")
        linecache.checkcache()
        for name in ("own_equations", "own_blocks"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        slope = importlib.import_module("own_equations").slope
        model = Model("own", (), ("x",), ("T",), (Call(slope, ("x", "T"), ("d_x",)),), ("x",))
        prints.append(fingerprint(model, source(model, 8)))
    assert prints[0] != prints[1]

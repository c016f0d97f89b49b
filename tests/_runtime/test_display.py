from dataclasses import dataclass

from errorscreen._runtime.display import Displayed, aligned, listed


class Thing(Displayed):
    def _facts(self):
        return {"name": "a < b", "values": "9" * 400}


def test_a_repr_is_short_whatever_it_holds():
    assert len(repr(Thing())) < 200
    assert repr(Thing()).startswith("Thing(name: a < b, values: 99")
    assert repr(Thing()).endswith("...)")


def test_a_dataclass_keeps_the_short_repr():
    @dataclass
    class Data(Thing):
        values: tuple[int, ...] = tuple(range(1000))

    assert repr(Data()).startswith("Data(name: a < b")


def test_a_notebook_table_is_escaped():
    assert "<th>name</th><td>a &lt; b</td>" in Thing()._repr_html_()


def test_texts_are_aligned_and_lists_are_cut():
    assert aligned({"a": 1, "long": 2.0}.items()) == "a     1\nlong  2"
    assert listed("abc", 3) == "a, b, c"

"""The report on paper: pages, words, and the same file for the same result."""

import re
import zlib
from dataclasses import replace

import pytest

from errorscreen.exceptions import InputError
from errorscreen.report import write_pdf
from errorscreen.report.pdf_report import _lines
from tests.report.samples import found, result, withdrawn
from tests.report.test_first_screen import corrected
from tests.report.test_html_report import figures


def words(result):
    return " ".join(" ".join(text for text, *_ in _lines(result)).split())


def test_it_has_pages_and_is_the_same_each_time(tmp_path):
    first = write_pdf(result(), figures(), tmp_path / "a.pdf").read_bytes()
    assert first.startswith(b"%PDF")
    assert len(re.findall(rb"/Type /Page\b", first)) == 1 + len(figures())
    assert write_pdf(result(), figures(), tmp_path / "b.pdf").read_bytes() == first


def test_a_long_text_goes_on_on_the_next_page(tmp_path):
    many = result(advice=tuple(f"Sentence number {n} of many." for n in range(120)))
    pages = write_pdf(many, [], tmp_path / "a.pdf").read_bytes()
    assert len(re.findall(rb"/Type /Page\b", pages)) == 3


def test_its_words_are_those_of_the_first_screen():
    text = words(found(gain=None, confirmed=None))
    assert "Excitation control. Its values: exciter.K 50 pu" in text
    assert "trip (fitted) P 5 MW -> 1.5 MW" in text
    assert "Record the field voltage." in text
    assert "accepted by" in text
    assert "Check first: doubtful" in words(result(hints=("doubtful",)))
    assert "The cause is unknown." in words(withdrawn())


def test_changes_of_the_file_are_told():
    told = words(found(gain=None))
    assert "Changes of" not in told
    changed = replace(corrected("H"), difference="-101 'GENROU' 3.0 /\n+101 'GENROU' 4.0 /")
    assert "Changes of unit.dyr -101 'GENROU' 3.0 / +101 'GENROU' 4.0 /" in words(
        replace(result(), correction=changed)
    )


def test_names_are_no_formulas(tmp_path):
    streams = write_pdf(result(hints=("a $\\frac$ of {x}",)), [], tmp_path / "a.pdf").read_bytes()
    assert any(
        zlib.decompress(s) for s in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", streams, re.DOTALL)[:1]
    )


@pytest.mark.filterwarnings("error")
def test_letters_without_a_glyph_and_control_characters_end_nothing(tmp_path):
    odd = replace(result(), hints=("\x1b[31m \u202e \u6e2c\u8a66",))
    assert write_pdf(odd, [], tmp_path / "a.pdf").stat().st_size > 1000


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_pdf(result(), [], tmp_path / "no" / "a.pdf")

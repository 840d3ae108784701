"""Fixture of modified instrument files."""

import pytest
from paper_file import paper_text

from fifesim.sensor.description.instruments import read_instrument


@pytest.fixture
def changed(tmp_path):
    """Function that reads the TM file, or another text, after replacements, given as old, new, old, new, ..."""

    def read(*replacements, text=None):
        text = paper_text() if text is None else text
        for old, new in zip(replacements[::2], replacements[1::2], strict=True):
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "mine.toml"
        path.write_text(text, encoding="utf-8")
        return read_instrument(path)

    return read

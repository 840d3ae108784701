"""Instrument files with one thing changed."""

import pytest
from paper_file import paper_text

from fifesim.sensor.description.instruments import read_instrument


@pytest.fixture
def changed(tmp_path):
    """Reads the TM file after replacements in its text, each old and new."""

    def read(*replacements):
        text = paper_text()
        for old, new in zip(replacements[::2], replacements[1::2], strict=True):
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "mine.toml"
        path.write_text(text, encoding="utf-8")
        return read_instrument(path)

    return read

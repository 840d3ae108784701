"""Instrument file of TM as described in the paper."""

import re

from fifesim.base import files


def paper_text():
    """Text of the TM file with only the response of the paper and without noise."""
    text = files.path("instruments/tm.toml").read_text(encoding="utf-8")
    text = re.sub(r"(?s)\[lsf\].*?\n\[paper_lsf\]", "[lsf]", text)
    text = re.sub(r"(?m)^(lsf|paper_lsf|noise|blur) = .*\n", "", text)
    return text.replace("[sources]\n", '[sources]\nlsf = "Friedl1995"\n')

"""Scenarios, studies and inputs of experiments, valid or not, from JSON Lines files in `data`."""

import json
from pathlib import Path


def lines(name):
    """Rows of a JSON Lines file."""
    text = (Path(__file__).parent / "data" / f"{name}.jsonl").read_text(encoding="utf-8")
    return [json.loads(line) for line in text.splitlines()[1:]]


def mistakes(*stages, name="scenario_mistakes"):
    """Stage, values and part of the error message of each mistake in the given stages."""
    return [each for each in lines(name) if each[0] in stages]


def cases(topic):
    """Values of scenarios of a topic, and the expected results."""
    return [(values, expected) for each, values, expected in lines("scenario_cases") if each == topic]


def check_message(message, start):
    """Check that a message has the given start, is printable and is short."""
    assert message.startswith(start) and message.splitlines()[0].isprintable() and len(message) <= 500

"""Metadata of images from anywhere."""

import os

import numpy as np
import pytest

from fifesim.sensor.products import metadata

SECRET = "not for anybody"


def test_text_and_xml_are_read(tmp_path):
    path = tmp_path / "a.xml"
    path.write_bytes(b'\xef\xbb\xbf<?xml version="1.0" encoding="UTF-8"?>\n<a unit="W/m\xc2\xb2"><b>1</b></a>')
    assert metadata.read_metadata(path).startswith("<?xml")
    root = metadata.read_xml(path)
    assert (root.tag, root.get("unit"), root.find("b").text) == ("a", "W/m²", "1")


@pytest.mark.parametrize(
    "text",
    [
        '<!DOCTYPE a [<!ENTITY b SYSTEM "{file}">]><a>&b;</a>',
        '<!DOCTYPE a SYSTEM "{file}"><a/>',
        '<!DOCTYPE a [<!ENTITY b "c"><!ENTITY d "&b;&b;&b;">]><a>&d;</a>',
    ],
)
def test_entities_are_not_followed(tmp_path, text):
    (tmp_path / "secret").write_text(SECRET)
    path = tmp_path / "a.xml"
    path.write_text(text.format(file=(tmp_path / "secret").as_uri()))
    with pytest.raises(ValueError, match=r"a\.xml declares a document type") as error:
        metadata.read_xml(path)
    assert SECRET not in str(error.value)


def test_a_document_type_in_another_encoding_is_no_text(tmp_path):
    """XML in UTF-16 shows its declarations to a parser, and not to a search for their letters."""
    path = tmp_path / "a.xml"
    path.write_bytes('<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'.encode("utf-16"))
    with pytest.raises(ValueError, match=r"a\.xml is no text"):
        metadata.read_xml(path)


def test_a_large_file_is_not_read(tmp_path, monkeypatch):
    path = tmp_path / "a.xml"
    path.write_text("<a>" + " " * 100 + "</a>")
    monkeypatch.setattr(metadata, "_LARGEST", 100)
    with pytest.raises(ValueError, match=r"a\.xml has 107 bytes: metadata has at most 100"):
        metadata.read_xml(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
def test_a_pipe_is_not_opened(tmp_path):
    os.mkfifo(tmp_path / "a.xml")
    with pytest.raises(ValueError, match="is a pipe"):
        metadata.read_xml(tmp_path / "a.xml")


@pytest.mark.parametrize("text", ["<a>", "<a></b>", "", "a" * 1000, "<a>" * 100])
def test_what_is_no_xml_is_one_line(tmp_path, text):
    path = tmp_path / "a.xml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"a\.xml is not valid XML") as error:
        metadata.read_xml(path)
    assert len(str(error.value)) < 450 and "\n" not in str(error.value)


def test_times_are_utc_to_the_nanosecond():
    assert metadata.utc_time("2020-12-04T19:02:11.1944860Z", "t") == np.datetime64("2020-12-04T19:02:11.194486", "ns")
    assert metadata.utc_time("2020-12-04T19:02:11", "t").dtype == "datetime64[ns]"


@pytest.mark.parametrize(
    "text", ["today", "now", "NaT", "", "2020-12-04", "2020-13-04T19:02:11Z", "2020-12-04T19:02:11+01:00"]
)
def test_other_times_are_refused(text):
    """numpy takes "today" for a time."""
    with pytest.raises(ValueError, match="SENSING_TIME must be a date and time such as 1987-06-06T16:35:00Z, got"):
        metadata.utc_time(text, "SENSING_TIME")


@pytest.mark.parametrize("text", ["9999-03-12T19:54:32Z", "2300-01-01T00:00:00Z", "1972-07-22T23:59:59Z"])
def test_times_before_the_launch_or_in_the_future_are_refused(text):
    """Nanoseconds of the year 9999 wrap around to 1815."""
    with pytest.raises(ValueError, match=f"T must lie between the launch .*, 1972-07-23, and today, .*, got '{text}'"):
        metadata.utc_time(text, "T")


def test_a_launch_may_be_given():
    now = str(np.datetime64("now", "s"))
    assert metadata.utc_time(now, "T", launch=now[:10]).astype("M8[s]") == np.datetime64(now)
    with pytest.raises(ValueError, match="launch of the satellite, 2017-03-07"):
        metadata.utc_time("2017-03-06T23:59:59Z", "T", launch="2017-03-07")


def test_errors_are_named_after_their_file():
    with pytest.raises(ValueError, match=r"^a\.xml: too large$"), metadata.naming("/b/a.xml"):
        raise ValueError("too large")

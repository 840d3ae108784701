"""Product metadata: safe reading, and consistency checks of values and solar position."""

import os

import numpy as np
import pytest

from fifesim.base.geometry import earth_sun_distance, sun_positions
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.products import metadata
from fifesim.sensor.response.calibration import ProductBand

TIME = np.datetime64("2020-06-06T17:00:00", "ns")
PLACE = (39.0, -96.5)
(SZA,), (SAA,) = sun_positions([str(TIME)], *PLACE)[1:3]
DISTANCE = earth_sun_distance(str(TIME))
RANGE = "KEY = 1 give values from .* states -0.09998 to 1.2107: .*fetch"
TM = instrument("TM")
(RED,) = TM.select("TM3")


def scale(gain, offset):
    metadata.check_product_scale("KEY = 1", gain, offset, (1, 65535), (-0.09998, 1.2107))


def unbounded(offset, largest):
    metadata.check_product_scale("K", 1e-4, offset, (1, largest), brightest=1.0)


def radiance(gain, limits):
    metadata.check_radiance("K", gain, -2.21398, (1, 255), limits)


def sun(turn):
    metadata.check_sun("K", SZA + turn, SAA, TIME, PLACE)


def distance(more):
    metadata.check_distance("K", DISTANCE + more, TIME)


def irradiance(factor):
    """Check a band; a band without irradiance and an unknown band are ignored."""
    others = ProductBand("TM4", "B4.TIF", 1e-3, 0.0, 255, None), ProductBand("TM9", "B9.TIF", 1e-3, 0.0, 255, 1.0)
    band = ProductBand("TM3", "B3.TIF", 1e-3, 0.0, 255, RED.solar_irradiance * factor)
    metadata.check_irradiance("LT05", (band, *others), TM)


CHECKS = [
    # Metadata are rounded to better than 0.05 %.
    (scale, [(2e-5, -0.1), (2.0009e-5, -0.1)], [(2.0011e-5, -0.1), (2e-5, -0.0993), (0, -0.1), (np.inf, -0.1)], RANGE),
    (unbounded, [(-0.25, 65534), (0.0999, 65534)], [(-0.26, 65534), (0.11, 65534)], r"must begin in \[-0.25, 0.1\]"),
    (unbounded, [(0.0, 10000), (0.0, 100_000)], [(0.0, 9999), (0.0, 100_001)], r"end in \[1, 10\]"),
    (radiance, [(1.044, (-1.17, 264.0))], [(1.050, (-1.17, 264.0))], "and the same file states -1.17 to 264"),
    (radiance, [], [(1.044, (264.0, -1.17))], "W m-2 sr-1 um-1, and the same file states 264 to -1.17"),
    (sun, [(0.0,), (1.9,), (-1.9,)], [(2.1,), (np.nan,)], "K: at 2020-06-06T17:00 UTC and 39.00 N, -96.50 E, the sun"),
    (irradiance, [(0.81,), (1.24,)], [(0.79,), (1.26,)], r"LT05: the scale of TM3 .* must be in \[1229, 1920\]"),
    (distance, [(9e-4,), (-9e-4,)], [(1.1e-3,), (-1.1e-3,)], "not belong to the date 2020-06-06, which has 1.0148"),
]


@pytest.mark.parametrize(("check", "good", "wrong", "said"), CHECKS)
def test_consistency_checks_have_their_limits(check, good, wrong, said):
    for numbers in good:
        check(*numbers)
    for numbers in wrong:
        with pytest.raises(ValueError, match=said):
            check(*numbers)


SECRET = "not for anybody"


def test_text_and_xml_are_read(tmp_path):
    path = tmp_path / "a.xml"
    path.write_bytes(b'\xef\xbb\xbf<?xml version="1.0" encoding="UTF-8"?>\n<a unit="W/m\xc2\xb2"><b>1</b></a>')
    assert metadata.read_metadata(path).startswith("<?xml")
    root = metadata.read_xml(path)
    assert (root.tag, root.get("unit"), root.find("b").text) == ("a", "W/m²", "1")


ENTITY = '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ('<!DOCTYPE a [<!ENTITY b SYSTEM "{file}">]><a>&b;</a>', "declares a document type"),
        ('<!DOCTYPE a SYSTEM "{file}"><a/>', "declares a document type"),
        ('<!DOCTYPE a [<!ENTITY b "c"><!ENTITY d "&b;&b;&b;">]><a>&d;</a>', "declares a document type"),
        # A parser sees declarations in UTF-16, but a search for ASCII text does not.
        (f'<?xml version="1.0" encoding="UTF-16"?>{ENTITY}'.encode("utf-16"), "is no text"),
        ("<a>" + " " * 2000 + "</a>", "has 2007 bytes: metadata has at most 2000"),
        *((text, "is not valid XML") for text in ("<a>", "<a></b>", "", "a" * 1000, "<a>" * 100)),
    ],
)
def test_unsafe_or_invalid_xml_raises_in_one_line(tmp_path, monkeypatch, content, said):
    """Entities are not followed, and large files not read."""
    monkeypatch.setattr(metadata, "_LARGEST", 2000)
    secret, path = tmp_path / "secret", tmp_path / "a.xml"
    secret.write_text(SECRET)
    path.write_bytes(content if isinstance(content, bytes) else content.replace("{file}", secret.as_uri()).encode())
    with pytest.raises(ValueError, match=rf"a\.xml {said}") as error:
        metadata.read_xml(path)
    assert len(str(error.value)) < 450 and "\n" not in str(error.value) and SECRET not in str(error.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
def test_pipe_is_not_opened(tmp_path):
    os.mkfifo(tmp_path / "a.xml")
    with pytest.raises(ValueError, match="is a pipe"):
        metadata.read_xml(tmp_path / "a.xml")


def test_times_are_utc_between_launch_and_today():
    """numpy accepts "today" as a time, and nanoseconds of the year 9999 overflow to 1815."""
    assert metadata.utc_time("2020-12-04T19:02:11.1944860Z", "t") == np.datetime64("2020-12-04T19:02:11.194486", "ns")
    assert metadata.utc_time("2020-12-04T19:02:11", "t").dtype == "datetime64[ns]"
    now = str(np.datetime64("now", "s"))
    assert metadata.utc_time(now, "T", launch=now[:10]).astype("M8[s]") == np.datetime64(now)
    no_times = "today", "now", "NaT", "", "2020-12-04", "2020-13-04T19:02:11Z", "2020-12-04T19:02:11+01:00"
    too_early_or_late = "9999-03-12T19:54:32Z", "2300-01-01T00:00:00Z", "1972-07-22T23:59:59Z"
    for texts, said in (
        (no_times, "T must be a date and time such as 1987-06-06T16:35:00Z, got"),
        (too_early_or_late, "T must lie between the launch .*, 1972-07-23, and today, .*, got "),
    ):
        for text in texts:
            with pytest.raises(ValueError, match=said) as error:
                metadata.utc_time(text, "T")
            assert repr(text) in str(error.value)
    with pytest.raises(ValueError, match="launch of the satellite, 2017-03-07"):
        metadata.utc_time("2017-03-06T23:59:59Z", "T", launch="2017-03-07")


def test_errors_start_with_the_file_name():
    with pytest.raises(ValueError, match=r"^a\.xml: too large$"), metadata.naming("/b/a.xml"):
        raise ValueError("too large")

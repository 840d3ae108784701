"""Text summary of instruments, compared with values computed by hand."""

import dataclasses

from fifesim.sensor.description.fields import Angles
from fifesim.sensor.description.instruments import instrument, instrument_names
from fifesim.sensor.description.listing import blur_in_words, instrument_in_words, list_instruments, noise_in_words


def test_summary_of_thematic_mapper():
    """Table 1: 43 urad from 705 km; the MTF of the cosine is 0.69 at Nyquist; 205.5 / 255 per count."""
    text = instrument_in_words(instrument("TM", "paper"))
    lines = text.splitlines()
    assert lines[0] == "TM  Landsat-5 Thematic Mapper"
    assert "  altitude 705 km, 8 bits" in lines and "  whiskbroom, 7.47 degrees to either side, swath 185 km" in text
    assert "  all bands: pixels of 30 m in the gridded product" in lines
    assert "    own interval 30.315 m at nadir" in lines
    assert "    line spread cosine, modulation transfer at the Nyquist frequency of the own interval 0.69" in lines
    # The cosine has a higher MTF than a detector as wide as the field of view.
    assert "    the detector alone has 0.64: images are sharper" in lines
    assert "whose blur is not known" not in text
    assert "that of the detector alone" in instrument_in_words(instrument("SuperDove"))
    (red,) = [line.split() for line in lines if line.startswith("  TM3")]
    assert red[5:8] == ["-1.20", "204.30", "0.8059"]


def test_summary_has_the_nyquist_mtf_of_each_axis():
    """Detectors of 1/2 and 1/4 of the interval: sinc(1/4) = 0.90 and sinc(1/8) = 0.97."""
    oli = instrument("OLI", "detector")
    wide = dataclasses.replace(
        oli, interval=Angles(along=4 * 42.5e-6, across=8 * 42.5e-6), ifov=2 * 42.5e-6, bands=instrument("OLI").bands[:1]
    )
    text = instrument_in_words(wide)
    assert "own interval 119.850 along x 239.700 across m" in text
    assert "of the own interval 0.90 along x 0.97 across" in text


def test_bands_of_equal_pixel_size_share_a_line_and_product_scales_are_stated():
    modis, msi, oli2 = (instrument_in_words(instrument(name)) for name in ("MODIS", "MSI", "OLI2"))
    assert "the detector alone has" not in modis and "Level-1 product" not in modis
    assert "  MODIS1, MODIS2: pixels of 250 m" in modis
    assert "  MODIS3, MODIS4, MODIS5, MODIS6, MODIS7: pixels of 500 m" in modis
    assert "  Level-1 product: 0.0001 x DN -0.1 is reflectance, 16 bits" in msi.splitlines()
    assert "is reflectance x cosine of the solar zenith angle, 16 bits" in oli2


def test_list_has_one_line_per_instrument():
    lines = list_instruments([instrument(name) for name in instrument_names()]).splitlines()
    assert [line.split()[0] for line in lines] == ["name", *instrument_names()]


def test_noise_and_blur_lines_list_missing_bands_and_sources():
    dove = instrument("SuperDove")
    assert noise_in_words(instrument("OLI"), ["OLI4"]) == "none"
    assert noise_in_words(dove, ["PS6", "PS8"]).startswith("none; the noise of PS6, PS8 is unknown, a public list")
    assert noise_in_words(dove, ["PS6"], ["thermal", "shot"]) == "thermal, shot"
    assert blur_in_words(dove, ["PS6"]).endswith(f"so the image is too sharp, {dove.not_found['blur']}")
    assert "sharper" not in blur_in_words(instrument("MSI"), ["MSI4"])
    said = "0.69; the detector alone has 0.64: the image of TM3 is sharper"
    assert blur_in_words(instrument("TM", "paper"), ["TM3"]).endswith(said)
    assert blur_in_words(instrument("TM"), ["TM3"]).startswith("modulation transfer at the Nyquist frequency 0.28")
    # User files need no such entry.
    own = dataclasses.replace(dove, not_found={})
    assert noise_in_words(own, ["PS6"]).endswith("the noise of PS6 is unknown")

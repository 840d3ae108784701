"""Metadata of Sentinel-2 tiles."""

import numpy as np
import products
import pytest

from fifesim.sensor.products.sentinel2 import sentinel2_tile


def written(folder, text, name="MTD_MSIL1C.xml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_tile_has_time_sun_and_views(tmp_path):
    tile = sentinel2_tile(written(tmp_path, products.tile_xml(1), "MTD_TL.xml"))
    assert tile.time == np.datetime64("2022-10-05T11:56:49.581767")
    assert (tile.sza, tile.saa) == (57.820574357679, 172.840206897213)
    assert tile.views == products.MEAN_VIEWS
    assert (tile.corner, tile.step) == ((499980.0, 5900040.0), 5000.0)
    np.testing.assert_allclose(tile.sun, products.sun_grid(), rtol=1e-5)
    assert tile.view_grids["3"].shape == (2, 2, 23, 23)
    assert np.isnan(tile.view_grids["3"][:, :, :, 20:]).all()


def test_a_tile_that_is_cut_short_is_refused(tmp_path):
    text = products.tile_xml(1)
    with pytest.raises(ValueError, match=r"MTD_TL.xml is not valid XML"):
        sentinel2_tile(written(tmp_path, text[: len(text) // 2], "MTD_TL.xml"))
    with pytest.raises(ValueError, match=r"SENSING_TIME must be a date and time such as .*'today'"):
        sentinel2_tile(written(tmp_path, text.replace("2022-10-05T11:56:49.581767Z", "today"), "MTD_TL.xml"))
    with pytest.raises(ValueError, match="a grid of Zenith is no table"):
        sentinel2_tile(written(tmp_path, text.replace("<VALUES>58.38", "<VALUES>58.38 much", 1), "MTD_TL.xml"))
    with pytest.raises(ValueError, match="not two rows and columns"):
        sentinel2_tile(written(tmp_path, text.replace("VALUES>", "VALUE>"), "MTD_TL.xml"))


NAN = products.tile_xml(1).replace("57.820574357679", "NaN").replace("172.840206897213", "NaN")


def test_a_mean_sun_of_nan_is_that_of_the_grid(tmp_path):
    tile = sentinel2_tile(written(tmp_path, NAN, "MTD_TL.xml"))
    zenith, azimuth = products.sun_grid()
    np.testing.assert_allclose([tile.sza, tile.saa], [zenith.mean(), azimuth.mean()], rtol=0, atol=0.01)


def test_a_sun_that_nothing_states_is_refused(tmp_path):
    zenith, _ = products.sun_grid()
    text = NAN.replace(products._values(zenith), products._values(zenith * np.nan))
    with pytest.raises(ValueError, match="Mean_Sun_Angle and Sun_Angles_Grid are NaN"):
        sentinel2_tile(written(tmp_path, text, "MTD_TL.xml"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "57.820574357679",
            "1.009",
            "Mean_Sun_Angle of zenith 1.009 and .* contradicts Sun_Angles_Grid, whose mean is 57.8",
        ),
        ("172.840206897213", "352.8", "contradicts Sun_Angles_Grid"),
        ("2022-10-05T", "9999-10-05T", "launch of the satellite, 2015-06-23, and today"),
        ("2022-10-05T", "2014-10-05T", "launch of the satellite, 2015-06-23, and today"),
        (
            "2022-10-05T",
            "2022-07-05T",
            "at 2022-07-05T11:56 UTC and 52.75 N, -8.19 E, the sun had a zenith angle of 31.0",
        ),
        ("EPSG:32629", "EPSG:4326", "HORIZONTAL_CS_CODE must be a UTM zone such as EPSG:32629, got 'EPSG:4326'"),
    ],
)
def test_contradictions_are_refused(tmp_path, old, new, said):
    text = products.tile_xml(1)
    assert old in text
    with pytest.raises(ValueError, match=f"MTD_TL.xml: .*{said}"):
        sentinel2_tile(written(tmp_path, text.replace(old, new), "MTD_TL.xml"))


def test_no_image_is_older_than_its_satellite(tmp_path):
    path = written(tmp_path, products.tile_xml(1).replace("2022-10-05T", "2016-10-05T"), "MTD_TL.xml")
    assert sentinel2_tile(path).time == np.datetime64("2016-10-05T11:56:49.581767")
    with pytest.raises(ValueError, match="launch of the satellite, 2017-03-07"):
        sentinel2_tile(path, "Sentinel-2B")

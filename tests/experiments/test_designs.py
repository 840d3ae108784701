"""Trade studies: budgets of the same designs, limits of theory, and the effect of each part of a design."""

import numpy as np
import pytest

import fifesim

_GRID = {"width": 4500, "height": 4500}
_BANDS = """
[[bands]]
name = "red"
center = 0.66
width = 0.03
snr = 90.0
snr_radiance = 22.0
[[bands]]
name = "nir"
center = 0.86
width = 0.03
snr = 120.0
snr_radiance = 14.0
"""


def _level(arp=0.22, **sections):
    return fifesim.Scenario(grid=_GRID, ground={"arp": arp}, terrain={"dem": "flat"}, **sections)


def _camera(folder, gsd, snr=1.0, bits=12, **keys):
    """Instrument file of a camera whose angles make pixels of a size."""
    lines = [f'name = "Camera {gsd:g}"', f"altitude = {gsd * 2e4}", f"gsd = {gsd}", f"bits = {bits}"]
    lines += [f"{key} = {value}" for key, value in keys.items()]
    bands = _BANDS.replace("90.0", str(90.0 * snr)).replace("120.0", str(120.0 * snr))
    path = folder / f"camera_{gsd:g}_{bits}.toml"
    path.write_text("\n".join(lines) + bands, encoding="utf-8")
    return str(path)


def test_designs_have_the_scatter_of_instruments_written_for_them(tmp_path):
    """Files of instruments with the pixel, blur and noise of a design, in a budget of all stages."""
    first = _camera(tmp_path, 30.0, mtf_at_nyquist=0.3)
    found = fifesim.trade(first, {"mtf": [0.3, 0.15], "pixel": [30.0, 20.0], "registration": [6.0]}, _level())
    for pixel, mtf in ((30.0, 0.3), (20.0, 0.15)):
        own = _camera(tmp_path, pixel, mtf_at_nyquist=mtf)
        sensor = {"instrument": own, "noise": ["all"], "offset": [6 / pixel, 6 / pixel]}
        total = fifesim.budget(_level(sensor=sensor), method="analytic", cells=1350)["total"].squeeze("realisation")
        r2 = found.r2.sel(pixel=pixel, mtf=mtf, variable=["lai", "fpar"]).squeeze()
        np.testing.assert_allclose(r2, 1 - total, atol=2e-4)


def test_rounding_has_the_scatter_of_digital_numbers(tmp_path):
    """Eight bits, noise of 0.1 digital numbers; with fewer bits, rounding depends on the signal or exceeds noise."""
    paths = [_camera(tmp_path, 30.0, bits=bits, mtf_at_nyquist=0.3) for bits in (8, 7)]
    with pytest.raises(ValueError, match=r"at most 0.03, and noise has 0.0\d+ digital numbers"):
        fifesim.trade(paths[1], {"registration": [0.0]}, _level())
    with pytest.raises(ValueError, match=r"noise has 0\.\d+ digital numbers, at least 0.5 is needed"):
        fifesim.trade(_camera(tmp_path, 60.0, snr=30.0, bits=5), {"registration": [0.0]}, _level(arp=0.1))
    found = fifesim.trade(paths[0], {"registration": [0.0]}, _level()).r2.sel(variable=["lai", "fpar"]).squeeze()
    sensor = {"instrument": paths[0], "noise": ["all"]}
    budget = fifesim.budget(_level(sensor=sensor), method="analytic", cells=1350).squeeze("realisation")
    np.testing.assert_allclose(found, 1 - budget["total"], atol=1e-3)
    assert (budget["alone"].sel(stage="quantisation") > 0.01).all()


def test_scatter_agrees_with_simulation_where_cells_do_not_divide_pixels(tmp_path):
    own = _camera(tmp_path, 25.0, mtf_at_nyquist=0.3)
    scenario = _level(sensor={"instrument": own, "noise": ["all"], "offset": [0.2, 0.2]})
    drawn = 1 - fifesim.budget(scenario, realisations=4, cells=675)["total"]
    found = (
        fifesim.trade(own, {"registration": [5.0]}, scenario).r2.squeeze("registration").sel(variable=["lai", "fpar"])
    )
    error = np.maximum(3 * drawn.std("realisation", ddof=1) / 2, 0.003)
    assert (abs(found - drawn.mean("realisation")) < error).all()


def test_a_thousand_designs_have_the_signs_of_theory():
    designs = {"pixel": [10, 20, 30, 60], "mtf": [0.1, 0.3, 0.5], "registration": [0, 5, 10], "snr": [20, 80, 320]}
    found = fifesim.trade("OLI", designs)
    assert found.r2.dims == ("variable", "pixel", "mtf", "registration", "snr")
    r2 = found.r2
    assert (r2.diff("snr") > 0).all() and (r2.diff("registration") < 0).all()
    # Blur averages noise, so that a sharper image is better only where noise is small.
    assert (r2.sel(registration=0, snr=320).diff("mtf") > 0).all()
    np.testing.assert_allclose(found.share.sum("stage"), 1 - r2, atol=1e-12)
    assert (found.share.sel(stage="registration", registration=0) == 0).all()
    # The variance of noise is inverse to the square of the ratio, and so is what it adds to 1 / R2.
    added = (1 / r2).transpose("snr", ...).values
    np.testing.assert_allclose((added[0] - added[2]) / (added[1] - added[2]), (20**-2 - 320**-2) / (80**-2 - 320**-2))
    # The variance of the ground of a pixel does not depend on the rest of the design.
    truth = found.rmse**2 / (1 - r2)
    np.testing.assert_allclose(truth, truth.mean(["mtf", "registration", "snr"]).broadcast_like(truth), rtol=1e-5)


def test_ideal_pixels_far_from_their_ground_have_no_relation_with_it():
    """At a distance of many correlation lengths, R2 is 0, and the slope too."""
    found = fifesim.trade("TM", {"registration": [0.0, 300.0]}, _level(arp=0.1))
    assert (abs(found.r2.sel(registration=300.0)) < 1e-3).all() and (found.r2.sel(registration=0.0) > 0.3).all()
    ideal = found.share.sel(stage="ground", variable="lai")
    # What an ideal instrument leaves does not depend on the design.
    assert float(ideal[0]) == float(ideal[1]) < 0.05
    # Larger pixels follow the ground less, with blur in proportion to the pixel and without noise to speak of.
    own = fifesim.instrument("OLI").replace(snr=5000.0)
    r2 = fifesim.trade(own, {"pixel": [10, 20, 30, 60], "registration": [0.0]}, _level(arp=0.24)).r2
    assert (r2.sel(variable="lai").diff("pixel") < 0).all()


def test_uncertainty_is_that_of_the_blur():
    designs = {"pixel": [20.0, 30.0], "registration": [0.0]}
    found = fifesim.trade("TM", designs, _level())
    ends = [fifesim.trade(fifesim.instrument("TM", end), designs, _level()).r2 for end in ("sharpest", "softest")]
    np.testing.assert_allclose(found.r2_uncertainty, abs(ends[0] - ends[1]) / 2)
    assert (found.r2_uncertainty > 0.01).all()
    assert np.isnan(fifesim.trade("TM", designs | {"mtf": [0.3]}, _level()).r2_uncertainty).all()


def test_unknown_geolocation_is_no_silent_zero(tmp_path):
    with pytest.warns(UserWarning, match="geolocation error of Camera 30 is unknown and taken as 0"):
        fifesim.trade(_camera(tmp_path, 30.0), {"pixel": [30.0]}, _level())


def test_the_front_joins_designs_that_no_cheaper_one_equals():
    designs = {"pixel": [10, 30], "snr": [30, 100, 300], "registration": [9.0, 3.0]}
    found = fifesim.trade("OLI", designs, _level())
    axes = fifesim.output.plot_trade(found, found.snr**2 / found.pixel**2, variable="gpp")
    (front,) = axes.get_lines()
    cost, best = front.get_data()
    assert (np.diff(cost) > 0).all() and (np.diff(best) > 0).all()
    r2 = found.r2.sel(variable="gpp")
    assert best[-1] == pytest.approx(float(r2.max()))
    price = (found.snr**2 / found.pixel**2).broadcast_like(r2)
    for one, own in zip(price.values.ravel(), r2.values.ravel(), strict=True):
        assert own <= best[cost <= one].max()

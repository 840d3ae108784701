"""Names, units and provenance."""

import numpy as np
import pytest
import xarray as xr

from fifesim.grids import cf


def raster(**attrs):
    return xr.DataArray(np.ones((2, 3)), dims=("y", "x"), name="mine", attrs=attrs)


# Names in version 85 of the CF standard name table, with their canonical units in the notation used here.
STANDARD_NAMES = {
    "area_fraction": "1",
    "atmosphere_optical_thickness_due_to_cloud": "1",
    "fraction_of_surface_downwelling_photosynthetic_radiative_flux_absorbed_by_vegetation": "1",
    # The canonical unit is kg m-2 s-1, to which this unit is convertible.
    "gross_primary_productivity_of_biomass_expressed_as_carbon": "g m-2 d-1",
    "ground_slope_angle": "degree",
    "ground_slope_direction": "degree",
    "leaf_area_index": "1",
    "normalized_difference_vegetation_index": "1",
    "vegetation_area_fraction": "1",
    "sensor_azimuth_angle": "degree",
    "sensor_band_central_radiation_wavelength": "um",
    "sensor_zenith_angle": "degree",
    "solar_azimuth_angle": "degree",
    "solar_irradiance_per_unit_wavelength": "W m-2 um-1",
    "solar_zenith_angle": "degree",
    "surface_albedo": "1",
    "surface_altitude": "m",
    "surface_bidirectional_reflectance": "1",
    "toa_bidirectional_reflectance": "1",
    "toa_outgoing_radiance_per_unit_wavelength": "W m-2 sr-1 um-1",
    "water_evapotranspiration_flux": "kg m-2 d-1",
}


def test_quantities_have_names_and_units_of_the_cf_table():
    for name, quantity in cf.QUANTITIES.items():
        if quantity.standard_name:
            assert quantity.units == STANDARD_NAMES[quantity.standard_name.removesuffix(" standard_error")], name
        else:
            assert quantity.units in {*STANDARD_NAMES.values(), "astronomical_unit"}, name
        assert quantity.long_name and set(cf.attributes(name)) <= {"standard_name", "long_name", "units", "comment"}
        assert all(cf.attributes(name).values())


def test_label_replaces_attributes():
    before = raster(units="percent", valid_range="0 100", history="mine")
    after = cf.label(before, "ndvi", history="ndvi")
    assert after.name == "ndvi"
    assert after.attrs == cf.attributes("ndvi") | {"history": "ndvi"}
    assert before.name == "mine" and before.attrs["units"] == "percent"


def test_provenance_and_history_are_propagated():
    source = raster(history="one", arp=0.15, references="Friedl", units="1", something="else")
    after = cf.label(raster(), "fpar", source=source, history="two", references="Tanre", arp=0.2)
    assert after.attrs["history"] == "one\ntwo"
    assert after.attrs["references"] == "Friedl; Tanre"
    again = cf.label(raster(), "toa_reflectance", source=after, history="to_toa", references="Tanre")
    assert again.attrs["references"] == "Friedl; Tanre"
    assert after.attrs["arp"] == 0.2
    assert "something" not in after.attrs


def test_wrong_units_are_named_with_the_expected_units():
    for units in ("1", "", "m2 m-2", " 1 ", "dimensionless"):
        cf.check_units(raster(units=units), "lai")
    cf.check_units(raster(), "lai")
    # rioxarray gives the units of bands as a tuple.
    radiance = xr.DataArray(np.zeros((3, 2, 2)), attrs={"units": ("W m-2 sr-1 um-1",) * 3})
    cf.check_units(radiance, "toa_radiance")
    with pytest.raises(ValueError, match="mine has units 'percent', toa_reflectance needs '1' or 'W m-2 sr-1 um-1'"):
        cf.check_units(raster(units="percent"), "toa_reflectance", "toa_radiance")
    with pytest.raises(ValueError, match="has units 'W m-2 sr-1 um-1', toa_reflectance needs '1'"):
        cf.check_units(radiance, "toa_reflectance")


def test_quantity_that_lacks_a_step_is_rejected_with_this_step(whole):
    """All have units of 1; only the standard name shows that a step was omitted."""
    red = whole["rho"].isel(band=0, drop=True)
    with pytest.raises(ValueError, match=r"leaf area index is needed.*take the raster of that quantity"):
        red.fifesim.fpar()
    cure = r"take \.fifesim\.surface_reflectance\(instrument\) of it first"
    with pytest.raises(ValueError, match=f"leaf area index by its standard_name.*{cure}"):
        whole["rho"].isel(band=0).assign_attrs(cf.attributes("lai")).fifesim.to_toa()


def test_band_coordinates_have_units():
    coordinates = cf.band_coordinates(band=["TM3", "TM4"], wavelength=[0.66, 0.83], gain=[1, 2])
    assert coordinates["band"].values.tolist() == ["TM3", "TM4"]
    assert coordinates["wavelength"].attrs["units"] == "um"
    assert coordinates["gain"].dtype == float and coordinates["gain"].dims == ("band",)

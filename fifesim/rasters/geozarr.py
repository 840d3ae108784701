"""Where a Zarr group lies, as the conventions that GeoZarr names say it."""

import pyproj

# By their identifiers: CRS of a group's arrays, and the affine transform of their rows and columns, as of version 0.1,
# https://github.com/zarr-conventions/proj and https://github.com/zarr-conventions/spatial.
_CONVENTIONS = {
    "proj": ("f17cb550-5864-4468-aeb7-f3180cfb622f", "Coordinate reference system information for geospatial data"),
    "spatial": ("689b58e2-cf7b-45e0-9fff-9cfc0883d6b4", "Spatial coordinate information"),
}


def attributes(grid):
    """
    Attributes of a group whose arrays lie on a grid, by the conventions ``proj`` and ``spatial``.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    attributes : dict
        That JSON holds. What CF says of the grid, by ``spatial_ref`` and ``grid_mapping``, is beside it.
    """
    box = grid.boundingbox
    return {
        "zarr_conventions": [
            {
                "uuid": uuid,
                "name": name,
                "schema_url": f"https://raw.githubusercontent.com/zarr-conventions/{name}/refs/tags/v0.1/schema.json",
                "spec_url": f"https://github.com/zarr-conventions/{name}/blob/v0.1/README.md",
                "description": description,
            }
            for name, (uuid, description) in _CONVENTIONS.items()
        ],
        **crs_fields(grid.crs.proj),
        "spatial:dimensions": ["y", "x"],
        "spatial:transform": list(grid.affine)[:6],
        "spatial:shape": list(grid.shape),
        "spatial:bbox": [box.left, box.bottom, box.right, box.top],
        "spatial:registration": "pixel",
    }


def crs_fields(crs):
    """
    A CRS by its code, or in full where it has none.

    Parameters
    ----------
    crs : pyproj.CRS, or what it takes

    Returns
    -------
    fields : dict
        ``proj:code`` or ``proj:wkt2``.
    """
    crs = pyproj.CRS.from_user_input(crs)
    authority = crs.to_authority(min_confidence=100)
    return {"proj:code": ":".join(authority)} if authority else {"proj:wkt2": crs.to_wkt()}

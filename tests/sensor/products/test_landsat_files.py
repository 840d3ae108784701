"""Metadata files of Landsat products, in the three forms of USGS."""

import products
import pytest

from fifesim.sensor.products.landsat import landsat_metadata_file, read_groups


def written(folder, groups, form="txt", root="LANDSAT_METADATA_FILE", name="LT05_L1TP_058014_20110312_20200823_02_T1"):
    path = folder / f"{name}_MTL.{form}"
    path.write_text(products.mtl(groups, form, root))
    return path


@pytest.mark.parametrize("form", ["txt", "json", "xml"])
@pytest.mark.parametrize("kind", [products.TM, products.OLI], ids=["TM", "OLI"])
def test_three_forms_say_the_same(tmp_path, kind, form):
    groups = products.landsat_groups(kind)
    assert read_groups(written(tmp_path, groups, form)) == groups


@pytest.mark.parametrize("form", ["txt", "json", "xml"])
def test_other_collections_are_refused(tmp_path, form):
    groups = products.landsat_groups(products.TM)
    with pytest.raises(ValueError, match="is of Collection 1 or older: take"):
        read_groups(written(tmp_path, groups, form, root="L1_METADATA_FILE"))
    groups["PRODUCT_CONTENTS"]["COLLECTION_NUMBER"] = "03"
    with pytest.raises(ValueError, match="is of collection '03': Collection 2 is read"):
        read_groups(written(tmp_path, groups, form))


@pytest.mark.parametrize(
    ("form", "text", "said"),
    [
        ("txt", "", "begins with None"),
        ("txt", "GROUP = SOMETHING\n  A = 1\nEND_GROUP = SOMETHING\n", "begins with 'SOMETHING'"),
        ("json", "[1, 2]", "begins with None"),
        ("json", "{", "not valid JSON"),
        ("json", '{"LANDSAT_METADATA_FILE": 3}', "of collection None"),
        ("xml", "<a>", "not valid XML"),
    ],
)
def test_files_that_are_no_metadata_are_refused(tmp_path, form, text, said):
    path = tmp_path / f"LT05_MTL.{form}"
    path.write_text(text)
    with pytest.raises(ValueError, match=said):
        read_groups(path)


def test_the_file_is_found_in_its_folder(tmp_path):
    groups = products.landsat_groups(products.TM)
    expected = written(tmp_path, groups)
    for form in ("json", "xml"):
        written(tmp_path, groups, form)
    (tmp_path / "LT05_ANG.txt").write_text("")
    assert landsat_metadata_file(tmp_path) == landsat_metadata_file(expected) == expected


def test_not_one_product_is_an_error(tmp_path):
    with pytest.raises(ValueError, match=r"there is no file or folder .*none"):
        landsat_metadata_file(tmp_path / "none")
    with pytest.raises(ValueError, match=r"has no \*_MTL.txt, .json or .xml: give the folder"):
        landsat_metadata_file(tmp_path)
    (tmp_path / "scene.tar").write_text("")
    with pytest.raises(ValueError, match=r"scene.tar is no metadata of a Landsat product: .*unpacked"):
        landsat_metadata_file(tmp_path / "scene.tar")
    for name in ("LT05_a", "LT05_b"):
        written(tmp_path, {}, name=name)
    with pytest.raises(ValueError, match=r"holds 2 products: give the file of one, LT05_a_MTL.txt, LT05_b_MTL.txt"):
        landsat_metadata_file(tmp_path)


@pytest.mark.parametrize("name", ["LT05_a_MTL.TXT", "LT05_a_mtl.Json", "LT05_a_MTL.XML"])
def test_the_file_is_found_in_upper_or_lower_case(tmp_path, name):
    (tmp_path / name).write_text("")
    assert landsat_metadata_file(tmp_path) == tmp_path / name
    (tmp_path / "lt05_a_mtl.xml").write_text("")
    assert landsat_metadata_file(tmp_path).stem.lower() == "lt05_a_mtl"


REPEATED = {
    "txt": ("    REFLECTANCE_MULT_BAND_3 =", "    REFLECTANCE_MULT_BAND_3 = 0.5\n    REFLECTANCE_MULT_BAND_3 ="),
    "json": ('"REFLECTANCE_MULT_BAND_3"', '"REFLECTANCE_MULT_BAND_3": "0.5", "REFLECTANCE_MULT_BAND_3"'),
    "xml": (
        "<REFLECTANCE_MULT_BAND_3>",
        "<REFLECTANCE_MULT_BAND_3>0</REFLECTANCE_MULT_BAND_3><REFLECTANCE_MULT_BAND_3>",
    ),
}


@pytest.mark.parametrize("form", REPEATED)
def test_repeated_keys_are_refused(tmp_path, form):
    path = written(tmp_path, products.landsat_groups(products.TM), form)
    path.write_text(path.read_text().replace(*REPEATED[form]))
    with pytest.raises(ValueError, match=r"LEVEL1_RADIOMETRIC_RESCALING key REFLECTANCE_MULT_BAND_3 twice: .*fetch"):
        read_groups(path)


GROUPS = {
    "txt": (
        "END_GROUP = LANDSAT_METADATA_FILE",
        "GROUP = IMAGE_ATTRIBUTES\nEND_GROUP = IMAGE_ATTRIBUTES\nEND_GROUP = LANDSAT_METADATA_FILE",
    ),
    "json": ('"IMAGE_ATTRIBUTES"', '"IMAGE_ATTRIBUTES": {"SPACECRAFT_ID": "LANDSAT_4"}, "IMAGE_ATTRIBUTES"'),
    "xml": ("<IMAGE_ATTRIBUTES>", "<IMAGE_ATTRIBUTES></IMAGE_ATTRIBUTES><IMAGE_ATTRIBUTES>"),
}


@pytest.mark.parametrize("form", GROUPS)
def test_repeated_groups_are_refused(tmp_path, form):
    path = written(tmp_path, products.landsat_groups(products.TM), form)
    path.write_text(path.read_text().replace(*GROUPS[form]))
    with pytest.raises(ValueError, match="has the group IMAGE_ATTRIBUTES twice"):
        read_groups(path)


def test_two_products_in_one_json_are_refused(tmp_path):
    path = tmp_path / "LT05_MTL.json"
    path.write_text('{"LANDSAT_METADATA_FILE": {}, "LANDSAT_METADATA_FILE": {}}')
    with pytest.raises(ValueError, match="holds 2 objects"):
        read_groups(path)

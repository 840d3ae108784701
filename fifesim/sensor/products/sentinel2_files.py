"""Metadata files of Sentinel-2 products: find them, and read the values of their XML elements."""

import re
from pathlib import Path

import numpy as np

from fifesim.base.foreign import in_a_line, shown
from fifesim.sensor.products.metadata_checks import CURE

# File names of the other form, in which Sentinel-2 lies in buckets of AWS.
_AWS = re.compile(r"((tile|product)Info\.json|((granule|product)_)?metadata\.xml|B\d[\dA]\.(jp2|tif))", re.IGNORECASE)


def metadata_file(path):
    """
    Find the metadata file of a product.

    Parameters
    ----------
    path : str or path
        The file itself, or its folder ``.SAFE``.

    Returns
    -------
    file : pathlib.Path

    Raises
    ------
    ValueError
        If there is no metadata file, or the folder has the layout of the AWS buckets.
    """
    path = Path(path)
    if path.is_dir():
        found = sorted(each for each in path.iterdir() if re.fullmatch(r"MTD_MSIL(1C|2A)\.xml", each.name))
        if len(found) == 1:
            return found[0]
        if not found and any(_AWS.fullmatch(each.name) for each in (*path.glob("*"), *path.glob("*/*"))):
            raise ValueError(_of_aws(path))
        old = any(re.match(r"S2._OPER_MTD_", each.name) for each in path.iterdir())
        raise ValueError(
            f"{in_a_line(path, 200)} has {'both' if found else 'no'} MTD_MSIL1C.xml {'and' if found else 'nor'} "
            "MTD_MSIL2A.xml: give the .SAFE folder of one product, unpacked"
            + ("; this one has the form of before December 2016, so take the reprocessed product" if old else "")
        )
    if not path.exists():
        raise ValueError(f"there is no file or folder {in_a_line(path, 200)}")
    if _AWS.fullmatch(path.name):
        raise ValueError(_of_aws(path))
    if path.suffix.lower() != ".xml":
        raise ValueError(f"{in_a_line(path.name, 100)} is no .SAFE folder nor its MTD_MSIL1C.xml: unpack the product")
    return path


def _of_aws(path):
    return (
        f"{in_a_line(path.name, 100)} has the layout of the AWS buckets (Sinergise, Element 84: metadata.xml, "
        "tileInfo.json, B04.jp2), not that of the product: fetch the product, which productInfo.json names, as .SAFE "
        "folder from the Copernicus Data Space (dataspace.copernicus.eu), unpack it, and give that folder"
    )


def by_band(root, key, attribute):
    """
    Numbers of a key that stands once for each band.

    Parameters
    ----------
    root : xml.etree.ElementTree.Element
    key, attribute : str
        Name of the element, and of its attribute with the number of the band.

    Returns
    -------
    numbers : dict of str to float

    Raises
    ------
    ValueError
        If a band has it twice, or a value is no number.
    """
    return unique([(each.get(attribute), number_of(each, ".")) for each in root.iter(key)], key)


def unique(pairs, key):
    """
    Dict of pairs, none of which may come twice.

    Parameters
    ----------
    pairs : sequence of (str, object)
    key : str
        Name of the quantity, for the message.

    Returns
    -------
    found : dict

    Raises
    ------
    ValueError
        If one comes twice.
    """
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [str(name) for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{key} stands twice for {in_a_line(twice, 60)}: {CURE}")
    return found


def part_of(element, path):
    """
    First element of a path; where there are several, they must say the same.

    Parameters
    ----------
    element : xml.etree.ElementTree.Element
    path : str
        Path from the element, ``"."`` for itself.

    Returns
    -------
    found : xml.etree.ElementTree.Element

    Raises
    ------
    ValueError
        If there is none, or there are several with different texts.
    """
    parts = [element] if path == "." else element.findall(path)
    key = path.rpartition("/")[2]
    if not parts:
        raise ValueError(f"the metadata have no {key}: is the file whole?")
    texts = sorted({(each.text or "").strip() for each in parts})
    if len(texts) > 1:
        values = in_a_line(", ".join(texts), 100)
        raise ValueError(f"{key} stands {len(parts)} times with different values, {values}: {CURE}")
    return parts[0]


def text_of(element, path):
    """
    Text of an element.

    Parameters
    ----------
    element, path
        As in `part_of`.

    Returns
    -------
    text : str
    """
    return (part_of(element, path).text or "").strip()


def number_of(element, path):
    """
    Number in an element.

    Parameters
    ----------
    element, path
        As in `part_of`.

    Returns
    -------
    number : float

    Raises
    ------
    ValueError
        If it is missing, or no finite number.
    """
    found = part_of(element, path)
    try:
        value = float(found.text)
    except (TypeError, ValueError):
        value = np.nan
    if not np.isfinite(value):
        raise ValueError(f"{found.tag} must be a number, got {shown((found.text or '').strip())}")
    return value

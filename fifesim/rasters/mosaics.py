"""What a mosaic (GDAL's VRT) names, read before GDAL does: opening one opens its sources, wherever they are."""

import os
import re
from xml.etree import ElementTree

# [byte]
_LARGEST = 64_000_000

# Elements of a plain mosaic. Warped and processed ones, raw bytes and functions in Python name files in many others.
_ELEMENTS = """
    VRTDataset SRS GeoTransform GCPList GCP Metadata MDI BlockXSize BlockYSize VRTRasterBand Description UnitType Offset
    Scale CategoryNames Category ColorInterp ColorTable Entry NoDataValue HideNoDataValue Histograms HistItem HistMin
    HistMax BucketCount IncludeOutOfRange Approximate HistCounts MaskBand OverviewList SimpleSource ComplexSource
    AveragedSource NoDataFromMaskSource SourceFilename SourceBand SourceProperties SrcRect DstRect NODATA ScaleOffset
    ScaleRatio LUT Exponent SrcMin SrcMax DstMin DstMax Clamp ColorTableComponent UseMaskBand
"""
_PLAIN = frozenset(_ELEMENTS.split())


def is_mosaic(path):
    """
    Whether a file is a mosaic, by its first bytes as GDAL looks at them.

    Parameters
    ----------
    path : str
        A regular file.

    Returns
    -------
    mosaic : bool
    """
    return b"<vrtdataset" in _head(path).lower()


def is_description(path):
    """
    Whether a file is XML or JSON, of which GDAL knows many that lead elsewhere.

    Parameters
    ----------
    path : str
        A regular file.

    Returns
    -------
    description : bool
    """
    return _head(path).lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"<", b"{")


def text_of(path):
    """
    The first line of a file of plain text, which no raster is but a grid of numbers.

    Parameters
    ----------
    path : str

    Returns
    -------
    line : str
        Empty of a file that is none, of one that may lead elsewhere, and of an archive's.
    """
    if not os.path.isfile(path) or is_description(path):
        return ""
    try:
        lines = _head(path).decode("utf-8").splitlines()
    except UnicodeDecodeError:
        return ""
    return lines[0] if lines and all(line.replace("\t", " ").isprintable() for line in lines) else ""


def named_files(path):
    """
    Files that a mosaic is made of.

    Parameters
    ----------
    path : str
        Of a mosaic.

    Returns
    -------
    files : list of str

    Raises
    ------
    ValueError
        If it is no plain mosaic of local files: the message goes on after "a mosaic".
    """
    elements = _elements(path)
    for each in elements:
        attributes = {key.lower(): value for key, value in each.attrib.items()}
        kind = attributes.get("subclass", each.tag)
        if each.tag not in _PLAIN or kind not in {*_PLAIN, "VRTSourcedRasterBand"}:
            raise ValueError(f"with {ascii(kind)[:60]}")
        # GDAL follows the name of a file of overviews.
        if each.tag == "MDI" and re.search("OVERVIEW_FILE", str(attributes), re.IGNORECASE):
            raise ValueError("with a file of overviews")
    return list(dict.fromkeys(_named(each, path) for each in elements if each.tag == "SourceFilename"))


def _head(path):
    with open(path, "rb") as file:
        return file.read(8192)


def _elements(path):
    if os.path.getsize(path) > _LARGEST:
        raise ValueError(f"of more than {_LARGEST // 1_000_000} MB")
    with open(path, "rb") as file:
        text = file.read()
    # GDAL does not expand what a document type declares, and would read another text.
    if b"<!" in text.replace(b"<!--", b""):
        raise ValueError("with a document type")
    try:
        return list(ElementTree.fromstring(text).iter())
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise ValueError(f"whose XML cannot be read ({str(error)[:60]})") from None


def _named(element, path):
    """Path of a source, which must be that of a file as it stands."""
    text = element.text or ""
    relative = [value for key, value in element.attrib.items() if key.lower() == "relativetovrt"] or ["0"]
    if len(element) or text != text.strip() or re.match(r"[\w+.-]{2,}:|/vsi|<", text) or relative not in (["0"], ["1"]):
        raise ValueError(f"of {ascii(text)[:90]}, which is no local file")
    found = os.path.join(os.path.dirname(path), text) if relative == ["1"] else text
    if not os.path.exists(found):
        raise ValueError(f"of {ascii(text)[:90]}, which is missing")
    return found

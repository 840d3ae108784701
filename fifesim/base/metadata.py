"""Metadata of images: text and XML of bounded size, which leads nowhere, and the times in it."""

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from fifesim.base.foreign import in_a_line, read_bounded, shown

# Larger than the metadata of any image. [byte]
_LARGEST = 20_000_000


def read_metadata(path):
    """
    Text of a file of metadata.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    text : str

    Raises
    ------
    ValueError
        If it is no regular file, too large, or no text in UTF-8.
    OSError
        If it is missing, or cannot be read.
    """
    try:
        return read_bounded(path, _LARGEST, "metadata").decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{in_a_line(Path(path).name)} is no text: is it another file?") from None


def read_xml(path):
    """
    Root of an XML file of metadata, which names no other file and defines no entity.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    root : xml.etree.ElementTree.Element

    Raises
    ------
    ValueError
        As in `read_metadata`; if it declares a document type, or is no XML.
    OSError
        If it is missing, or cannot be read.
    """
    text, name = read_metadata(path), in_a_line(Path(path).name)
    # Entities, which may name files or grow without end, are declared in a document type. In UTF-8, which is what it
    # is read as here, nothing else begins so.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError(f"{name} declares a document type, which metadata of images do not: it is not read")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise ValueError(in_a_line(f"{name} is not valid XML: {error}")) from None


def utc_time(text, key):
    """
    Time of metadata, which is UTC.

    Parameters
    ----------
    text : str
        Date and time of day, perhaps with parts of a second and a Z.
    key : str
        What it is called in a message.

    Returns
    -------
    time : numpy.datetime64

    Raises
    ------
    ValueError
        If it is no such time.

    Examples
    --------
    >>> utc_time("1987-06-06T16:35:00.5Z", "time").astype(str)[:21]
    '1987-06-06T16:35:00.5'
    """
    match = re.fullmatch(r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?)Z?", text)
    try:
        return np.datetime64(match[1] if match else "none", "ns")
    except ValueError:
        raise ValueError(f"{key} must be a date and time such as 1987-06-06T16:35:00Z, got {shown(text)}") from None

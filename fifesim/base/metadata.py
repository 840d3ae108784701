"""Metadata of images: text and XML of bounded size, which leads nowhere, and the times in it."""

import re
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from fifesim.base.foreign import in_a_line, read_bounded, shown

# Larger than the metadata of any image. [byte]
_LARGEST = 20_000_000

# Landsat 1.
_FIRST_LAUNCH = "1972-07-23"


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


@contextmanager
def naming(path):
    """
    Begin the message of a ValueError with the name of the file that is at fault.

    Parameters
    ----------
    path : str or path

    Raises
    ------
    ValueError
        The error of the block, with the name.
    """
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{in_a_line(Path(path).name, 100)}: {error}") from None


def utc_time(text, key, launch=_FIRST_LAUNCH):
    """
    Time in metadata, which is UTC.

    Parameters
    ----------
    text : str
        Date and time of day, with or without a fraction of a second and a Z.
    key : str
        Name of the quantity in messages.
    launch : str, optional
        Date of launch of the satellite, before which it took no image; by default the launch of the first Landsat.

    Returns
    -------
    time : numpy.datetime64

    Raises
    ------
    ValueError
        If the text is no date and time, or the time lies before the launch or in the future.

    Examples
    --------
    >>> utc_time("1987-06-06T16:35:00.5Z", "time").astype(str)[:21]
    '1987-06-06T16:35:00.5'
    """
    match = re.fullmatch(r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?)Z?", text)
    try:
        # Nanoseconds end in 2262, beyond which numpy wraps around without an error.
        seconds = np.datetime64(match[1][:19] if match else "none", "s")
    except ValueError:
        raise ValueError(f"{key} must be a date and time such as 1987-06-06T16:35:00Z, got {shown(text)}") from None
    # A clock may be a day behind.
    today = np.datetime64("now", "s")
    if not np.datetime64(launch, "s") <= seconds <= today + np.timedelta64(1, "D"):
        raise ValueError(
            f"{key} must lie between the launch of the satellite, {launch}, and today, {today.astype('M8[D]')}, got "
            f"{shown(text)}: the date was changed, so fetch the product's metadata again"
        )
    return np.datetime64(match[1], "ns")

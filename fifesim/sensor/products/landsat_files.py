"""Metadata files of Landsat Collection-2 products: find them, and read their text, JSON or XML into groups of keys."""

import json
import re
from pathlib import Path

from fifesim.base.foreign import in_a_line, shown
from fifesim.base.metadata import read_metadata, read_xml

_ROOT = "LANDSAT_METADATA_FILE"

# The name of a metadata file in upper or lower case, as unpacking programs and other packages leave it.
_METADATA = re.compile(r".*_MTL\.(txt|json|xml)", re.IGNORECASE)

# Where a product has its metadata in several forms, the first of these is read.
_FORMS = (".txt", ".json", ".xml")


def metadata_file(path):
    """
    Find the metadata file of a product.

    Parameters
    ----------
    path : str or path
        The file itself, or its folder.

    Returns
    -------
    file : pathlib.Path

    Raises
    ------
    ValueError
        If there is no metadata file, or the folder holds several products.
    """
    path = Path(path)
    if not path.is_dir():
        if not path.exists():
            raise ValueError(f"there is no file or folder {in_a_line(path, 200)}")
        if not _METADATA.fullmatch(path.name):
            raise ValueError(
                f"{in_a_line(path.name, 100)} is no metadata of a Landsat product: give its *_MTL.txt (.json, .xml), "
                "or the folder of the unpacked product"
            )
        return path
    files = [each for each in sorted(path.iterdir()) if _METADATA.fullmatch(each.name)]
    found = {}
    for file in sorted(files, key=lambda each: _FORMS.index(each.suffix.lower())):
        found.setdefault(file.stem.lower(), file)
    if not found:
        raise ValueError(
            f"{in_a_line(path, 200)} has no *_MTL.txt, .json or .xml: give the folder of one Landsat Collection-2 "
            "product, unpacked"
        )
    if len(found) > 1:
        names = in_a_line(", ".join(each.name for each in found.values()), 200)
        raise ValueError(f"{in_a_line(path.name, 100)} holds {len(found)} products: give the file of one, {names}")
    return next(iter(found.values()))


def read_groups(path):
    """
    Read the values of a metadata file by group; some keys stand in several groups, with different values.

    Parameters
    ----------
    path : str or path
        File ending in ``.txt``, ``.json`` or ``.xml``.

    Returns
    -------
    groups : dict of str to dict of str
        All values as text.

    Raises
    ------
    ValueError
        If the product is not of Collection 2, the file cannot be read, or it repeats a group, or a key within a group.
    """
    path = Path(path)
    name = in_a_line(path.name, 100)
    readers = {".json": _json_pairs, ".xml": _xml_pairs}
    root, pairs = readers.get(path.suffix.lower(), _text_pairs)(path)
    if root == "L1_METADATA_FILE":
        raise ValueError(f"{name} is of Collection 1 or older: take the scene's Collection-2 product, which USGS has")
    if root != _ROOT:
        raise ValueError(f"{name} is no metadata of a Landsat product: it begins with {shown(root)}, not {_ROOT}")
    groups = _unique(pairs, name, "group")
    groups = {group: _unique(values, name, f"{group} key") for group, values in groups.items() if values}
    collection = groups.get("PRODUCT_CONTENTS", {}).get("COLLECTION_NUMBER")
    if collection is None or collection.lstrip("0") != "2":
        raise ValueError(f"{name} is of collection {shown(collection)}: Collection 2 is read")
    return groups


def _unique(pairs, name, what):
    """Dict of pairs, none of which may come twice."""
    found = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(
                f"{name} has the {what} {in_a_line(key, 60)} twice: the file was changed or joined, and nothing says "
                "which one holds; fetch the product's metadata again"
            )
        found[key] = value
    return found


def _text_pairs(path):
    """First group, and pairs of a group and its pairs of key and value, in the text form."""
    root, pairs, around = None, [], []
    for line in read_metadata(path).splitlines():
        key, separator, value = (part.strip() for part in line.partition("="))
        if key == "GROUP":
            root = root or value
            pairs.append((value, []))
            around.append(pairs[-1])
        elif key == "END_GROUP":
            around = around[:-1]
        elif separator and around:
            around[-1][1].append((key, value.strip('"')))
    return root, pairs


def _json_pairs(path):
    """Same as `_text_pairs` in JSON; every object is a tuple of its pairs, so that repeated keys are seen."""
    try:
        content = json.loads(read_metadata(path), object_pairs_hook=tuple)
    except (ValueError, RecursionError) as error:
        raise ValueError(in_a_line(f"{path.name} is not valid JSON: {error}")) from None
    if not isinstance(content, tuple) or not content:
        return None, []
    if len(content) > 1:
        raise ValueError(f"{in_a_line(path.name, 100)} holds {len(content)} objects: metadata are one, {_ROOT}")
    ((root, groups),) = content
    groups = groups if isinstance(groups, tuple) else ()
    return root, [
        (group, [(key, str(value)) for key, value in values]) for group, values in groups if isinstance(values, tuple)
    ]


def _xml_pairs(path):
    """Same as `_text_pairs` in XML."""
    root = read_xml(path)
    return root.tag, [(group.tag, [(each.tag, (each.text or "").strip()) for each in group]) for group in root]

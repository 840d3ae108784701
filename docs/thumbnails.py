"""Thumbnails of the gallery: one panel of each page, drawn with the page."""

import re
from io import BytesIO
from pathlib import Path

import matplotlib.pyplot as plt
from PIL import Image, ImageChops, ImageOps
from sphinx_gallery.scrapers import matplotlib_scraper

# Size of a thumbnail [pixel], resolution of the panel [dots per inch], and its margin [inch].
SIZE, _DPI, _MARGIN = (400, 280), 160, 0.04


def scrape(block, block_vars, gallery_conf, **options):
    """Save the figures of a block as sphinx-gallery does, and the panel that is the thumbnail of the page."""
    script, page = Path(block_vars["src_file"]), Path(block_vars["target_file"])
    number, panel = _chosen(script.read_text("utf-8"))
    made = len(block_vars["image_path_iterator"])
    for at, figure in enumerate(map(plt.figure, plt.get_fignums()), made + 1):
        if at == number:
            save_panel(figure, panel, panel_file(page.parent, script.stem))
    return matplotlib_scraper(block, block_vars, gallery_conf, **options)


def _chosen(text):
    """Number of the figure, from 1, and of its panel, from 0, that the comments of a script name."""
    figure = re.search(r"^# sphinx_gallery_thumbnail_number = (\d+)", text, re.MULTILINE)
    panel = re.search(r"^# thumbnail_panel = (\d+)", text, re.MULTILINE)
    return int(figure[1]) if figure else 1, int(panel[1]) if panel else 0


def panel_file(folder, stem):
    return folder / "images" / f"{stem}_panel.png"


def save_panel(figure, panel, path):
    """Save one panel of a figure with its labels."""
    whole = BytesIO()
    figure.savefig(whole, dpi=_DPI, facecolor="white")
    box = figure.axes[panel].get_tightbbox().transformed(figure.dpi_scale_trans.inverted())
    picture = Image.open(whole).convert("RGB")
    left, right = _DPI * (box.x0 - _MARGIN), _DPI * (box.x1 + _MARGIN)
    top, bottom = (
        picture.height - _DPI * each for each in (box.y1 + _MARGIN, box.y0 - _MARGIN)
    )
    inside = max(left, 0), max(top, 0), min(right, picture.width), min(bottom, picture.height)
    path.parent.mkdir(parents=True, exist_ok=True)
    picture.crop(tuple(map(round, inside))).save(path)


def thumbnail(panel):
    """Picture of a panel, without white margins, in the middle of a thumbnail."""
    picture = Image.open(panel).convert("RGB")
    white = Image.new("RGB", picture.size, "white")
    picture = picture.crop(ImageChops.difference(picture, white).getbbox())
    return ImageOps.pad(picture, SIZE, Image.Resampling.LANCZOS, color="white")

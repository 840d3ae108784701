"""Only files of this machine, of known formats, are opened; whatever else is refused in one line."""

import os
import socket
import threading
import zipfile

import numpy as np
import pytest
import rasterio
import rasterio.shutil
import rasterio.vrt
from affine import Affine

import fifesim
from fifesim.grids import opening

GRID = fifesim.grid_at("EPSG:26914", 708000.0, 4332000.0, 240.0, 200.0, 10.0)


def write(path, **other):
    """An ordinary raster around the grid."""
    profile = {"driver": "GTiff", "width": 60, "height": 60, "count": 1, "dtype": "float32", "crs": "EPSG:26914"}
    profile |= {"transform": Affine(10, 0, 707900, 0, -10, 4332100)} | other
    with rasterio.open(path, "w", **profile) as sink:
        sink.write(np.full((profile["count"], 60, 60), 3, "float32"))
    return str(path)


def mosaic(path, source, relative=0, inside="", band=""):
    path.write_text(
        f'<VRTDataset rasterXSize="60" rasterYSize="60"><SRS>EPSG:26914</SRS>{inside}'
        "<GeoTransform>707900,10,0,4332100,0,-10</GeoTransform>"
        f'<VRTRasterBand dataType="Float32" band="1" {band}><SimpleSource><SourceFilename relativeToVRT="{relative}">'
        f"{source}</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"
    )
    return str(path)


@pytest.fixture
def server():
    """An address, and who has asked there."""
    asked = []
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def answer():
            while True:
                try:
                    caller, _ = listening.accept()
                except OSError:
                    return
                with caller:
                    asked.append(caller.recv(1000))
                    caller.send(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")

        threading.Thread(target=answer, daemon=True).start()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}/x.tif", asked


DOORS = [
    fifesim.open_image,
    lambda path, **options: fifesim.open_lai(path, GRID, **options),
    lambda path, **options: fifesim.fine_dem(path, GRID, **options),
]


def tms(address):
    return (
        f'<GDAL_WMS><Service name="TMS"><ServerUrl>{address}?${{z}}</ServerUrl></Service><DataWindow><UpperLeftX>707900'
        "</UpperLeftX><UpperLeftY>4332100</UpperLeftY><LowerRightX>708500</LowerRightX><LowerRightY>4331500"
        "</LowerRightY><SizeX>60</SizeX><SizeY>60</SizeY><TileLevel>0</TileLevel></DataWindow><Projection>EPSG:26914"
        "</Projection><BandsCount>1</BandsCount></GDAL_WMS>"
    )


@pytest.mark.parametrize("door", DOORS, ids=["image", "lai", "dem"])
def test_no_address_is_asked_unless_allowed(tmp_path, server, door):
    address, asked = server
    (tmp_path / "tms.tif").write_text(tms(address))
    beside = write(tmp_path / "beside.tif")
    (tmp_path / "beside.tif.msk").write_text(tms(address))
    hostile = [
        address,
        f"/vsicurl/{address}",
        f"/vsizip//vsicurl/{address}/a.tif",
        "/vsis3/bucket/a.tif",
        tms(address),
        str(tmp_path / "tms.tif"),
        beside,
        mosaic(tmp_path / "curl.vrt", f"/vsicurl/{address}"),
        mosaic(tmp_path / "tms.vrt", "tms.tif", relative=1),
        mosaic(tmp_path / "nested.vrt", "curl.vrt", relative=1),
    ]
    for path in hostile:
        with pytest.raises(ValueError, match=r"allow_remote=True") as refused:
            door(path)
        assert len(str(refused.value)) <= 500 and str(refused.value).isprintable()
    assert not asked
    with pytest.raises(ValueError, match="404"):
        door(address.replace("x.tif", f"{id(door)}.tif"), allow_remote=True)
    assert asked


def test_a_context_allows_what_an_argument_does(server):
    address, asked = server
    with opening.remote_allowed(), pytest.raises(ValueError, match="404"):
        opening.raster_file(address.replace("x.tif", "context.tif"))
    assert asked
    with pytest.raises(ValueError, match="--allow-remote"):
        opening.raster_file(address)


def test_lazy_tasks_keep_what_was_decided(tmp_path):
    """Threads and workers know of no context."""
    path = tmp_path / "warped.vrt"
    with rasterio.open(write(tmp_path / "a.tif")) as source, rasterio.vrt.WarpedVRT(source, crs="EPSG:26914") as warped:
        rasterio.shutil.copy(warped, path, driver="VRT")
    with pytest.raises(ValueError, match=r"warped\.vrt is a mosaic with 'VRTWarpedDataset', and is not opened"):
        fifesim.open_lai(path, GRID)
    with opening.remote_allowed():
        lazy = fifesim.open_lai(path, GRID, chunks=7), fifesim.open_image(path, chunks=7)
    assert all((each.compute(scheduler="threads") == 3).all() for each in lazy)


def test_mosaics_and_archives_of_this_machine_are_opened(tmp_path):
    path = write(tmp_path / "a.tif")
    plain = mosaic(tmp_path / "a.vrt", "a.tif", relative=1)
    for each in (plain, mosaic(tmp_path / "b.vrt", plain)):
        assert (fifesim.open_lai(each, GRID) == 3).all()
        assert (fifesim.open_image(each) == 3).all()
    packed = tmp_path / "a.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.write(path, "a.tif")
    assert (fifesim.open_lai(f"/vsizip/{packed}/a.tif", GRID) == 3).all()


def test_what_is_no_file_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    os.symlink(tmp_path / "loop", tmp_path / "loop")
    refused = {
        tmp_path / "pipe": "is a pipe: name a file",
        "/dev/zero": "is a device",
        tmp_path: "is a folder",
        f"/vsizip/{tmp_path}/pipe/a.tif": "is a pipe",
        tmp_path / "loop": "symbolic links",
        "x" * 5000: "too long",
        "a\0.tif": "null",
        tmp_path / "\x1b[2J.tif": r"\\x1b\[2J\.tif as a raster: no raster file is there",
    }
    for path, reason in refused.items():
        for door in DOORS:
            with pytest.raises(ValueError, match=reason) as said:
                door(path)
            assert len(str(said.value)) <= 500 and str(said.value).isprintable()


def test_a_cut_file_names_itself(tmp_path):
    rasterio.shutil.copy(write(tmp_path / "a.tif"), tmp_path / "cut.tif", driver="COG", compress="none")
    data = (tmp_path / "cut.tif").read_bytes()
    (tmp_path / "cut.tif").write_bytes(data[: len(data) // 2])
    with pytest.raises(OSError, match=r"cannot read .*cut\.tif"):
        fifesim.open_image(tmp_path / "cut.tif")
    with pytest.raises(OSError, match=r"cannot read .*cut\.tif"):
        fifesim.open_image(tmp_path / "cut.tif", chunks=20).compute()
    with pytest.raises(OSError, match=r"cannot read .*cut\.tif"):
        fifesim.open_lai(tmp_path / "cut.tif", GRID)
    with pytest.raises(OSError, match=r"cannot read .*cut\.tif"):
        fifesim.fine_dem(tmp_path / "cut.tif", GRID)


@pytest.mark.parametrize(("name", "text"), [("points.xyz", "x;y;lai"), ("lai.txt", "plot,lai"), ("lai.tif", "sorry")])
def test_plain_text_is_told_as_such_and_not_as_a_matter_of_trust(tmp_path, name, text):
    (tmp_path / name).write_text(f"{text}\n1 2\n")
    with pytest.raises(ValueError, match=f"{name} as a raster of GTiff.*; it is text that begins '{text}'") as caught:
        opening.raster_file(tmp_path / name)
    assert "allow_remote" not in str(caught.value) and len(str(caught.value)) <= 500


def test_other_formats_stay_a_matter_of_trust(tmp_path):
    for name, content in (("a.nc", b"CDF\x01\0\0\0\0"), ("b.xml", b"<Service/>"), ("c.json", b"{}")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ValueError, match="allow_remote=True"):
            opening.raster_file(tmp_path / name)


def test_a_file_that_may_not_be_read_says_so(tmp_path, monkeypatch):
    """A superuser may read all: the system's refusal is made up."""
    path = write(tmp_path / "secret.tif")

    def refuse(*given):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(opening, "open", refuse, raising=False)
    with pytest.raises(ValueError, match=r"cannot read .*secret\.tif as a raster: Permission denied"):
        opening.raster_file(path)

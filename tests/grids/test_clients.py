"""A cluster is found by its client, and costs nothing where there is none."""

import subprocess
import sys

from distributed import Client, LocalCluster

from fifesim.grids.chunks import found_client


def test_client_is_found_while_there_is_one():
    assert found_client() is None
    with LocalCluster(n_workers=1, processes=False, dashboard_address=None) as cluster, Client(cluster) as client:
        assert found_client() is client
    assert found_client() is None


def test_writing_needs_no_cluster():
    modules = "fifesim.grids.files, fifesim.output.run.folder"
    code = f"import sys, {modules}; assert not {{'distributed', 'zarr'}} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)

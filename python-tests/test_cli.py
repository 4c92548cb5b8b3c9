"""The console script is the same program as the binary."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scansion

SCRIPT = shutil.which("scansion", path=str(Path(sys.executable).parent)) or shutil.which("scansion")


def run(*arguments):
    return subprocess.run([SCRIPT, *map(str, arguments)], capture_output=True, text=True)


@pytest.fixture(autouse=True)
def installed():
    if SCRIPT is None:
        pytest.skip("the console script is not installed")


def test_the_version_is_that_of_the_package():
    assert scansion.__version__ in run("--version").stdout
    module = subprocess.run([sys.executable, "-m", "scansion", "--version"], capture_output=True, text=True)
    assert scansion.__version__ in module.stdout


def test_info_tells_the_header(tmp_path, labelled):
    scansion.write(tmp_path / "a.laz", labelled)
    done = run("info", "--format", "json", tmp_path / "a.laz")
    assert done.returncode == 0, done.stderr
    assert str(len(labelled)) in json.dumps(json.loads(done.stdout))


def test_exit_codes_reach_the_shell(tmp_path):
    assert run("--no-such-flag").returncode == 2
    assert run("info", tmp_path / "absent.las").returncode == 4


def test_optimal_neighbourhoods_are_those_of_the_function(tmp_path, labelled):
    scansion.write(tmp_path / "a.laz", labelled)
    cloud = scansion.read(tmp_path / "a.laz")
    done = run("features", tmp_path / "a.laz", "-o", tmp_path / "a.npy", "--optimal", "--neighbours", "10,40")
    assert done.returncode == 0, done.stderr
    k, found = scansion.neighbours.optimal(cloud, k_min=10, k_max=40)
    table = np.load(tmp_path / "a.npy")
    np.testing.assert_array_equal(table[:, :4], found)
    np.testing.assert_array_equal(table[:, 4], k)
    done = run("features", tmp_path / "a.laz", "-o", tmp_path / "b.laz", "--optimal", "--only", "OptimalPlanarity,Neighbours")
    assert done.returncode == 0, done.stderr
    written = scansion.read(tmp_path / "b.laz")
    assert "OptimalPlanarity" in written and "OptimalLinearity" not in written
    assert written["Neighbours"].min() >= 10 and written["Neighbours"].max() <= 100
    assert run("features", tmp_path / "a.laz", "-o", tmp_path / "c.npy", "--optimal", "--set", "a=1").returncode == 2

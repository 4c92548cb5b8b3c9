"""Clouds that several test files use."""

import os
from pathlib import Path

import numpy as np
import pytest
import scansion

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real clouds."""
    folder = Path(os.environ.get("SCANSION_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir() and "SCANSION_REQUIRE_DATA" in os.environ:
        pytest.fail(f"real clouds are absent: no folder {folder}")
    if not folder.is_dir():
        pytest.skip("real clouds are absent; set SCANSION_DATA to their folder")
    return folder


def street(seed: int = 0, points: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Ground (2), a wall (6) and a bush (5), and the label of each point."""
    random = np.random.default_rng(seed)
    n = points // 4
    ground = np.column_stack([random.uniform(0, 20, (2 * n, 2)), random.normal(0, 0.02, 2 * n)])
    wall = np.column_stack([random.uniform(0, 20, n), random.normal(20, 0.02, n), random.uniform(0, 8, n)])
    bush = random.normal([10, 8, 2], 1.0, (n, 3))
    labels = np.repeat([2, 6, 5], [2 * n, n, n]).astype(np.uint8)
    return np.concatenate([ground, wall, bush]) + [500_000, 5_000_000, 0], labels


@pytest.fixture
def labelled() -> scansion.PointCloud:
    xyz, labels = street()
    return scansion.PointCloud(xyz, Classification=labels)

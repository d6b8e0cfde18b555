"""Recordings and legs of the repository."""

from pathlib import Path

import numpy as np
import pytest

import scarab_ident as si

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def mujoco():
    """Leg and recording that MuJoCo simulated."""
    leg = si.Leg.from_toml("mujoco-leg")
    return leg, si.read_recording(ROOT / "tests/data/mujoco_leg/fourier.csv", leg)


@pytest.fixture(scope="session")
def identified(mujoco):
    leg, recording = mujoco
    return leg.identify(*recording, split=0.67)


@pytest.fixture
def states():
    random = np.random.default_rng(7)
    return [random.normal(size=(400, 2)) * scale for scale in (1.0, 2.0, 5.0)]

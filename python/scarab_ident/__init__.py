"""Dynamics of a leg of one to three joints: identification, regressor, exciting motion, beetle swarm.

Angles are anatomical as in the leg file (flexion positive), in rad; torques act at the joint, in N m; times are
in s. Arrays have a row for each sample and a column for each joint, proximal joint first.
"""

from ._native import (
    Identification,
    InputError,
    Leg,
    Motion,
    RefusedError,
    beetle_swarm,
    read_recording,
)
from ._records import Curves, Minimum, Parameter, Prediction, Recording, Samples, Simulation

__all__ = [
    "Curves",
    "Identification",
    "InputError",
    "Leg",
    "Minimum",
    "Motion",
    "Parameter",
    "Prediction",
    "Recording",
    "RefusedError",
    "Samples",
    "Simulation",
    "beetle_swarm",
    "read_recording",
]

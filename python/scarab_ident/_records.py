"""Records that functions return."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ._native import Identification


class Recording(NamedTuple):
    """Recorded motion: `leg.identify(*recording)`."""

    t: NDArray[np.float64]
    """Time, s, shape (samples,)."""
    q: NDArray[np.float64]
    """Joint angles, rad, shape (samples, joints)."""
    tau: NDArray[np.float64]
    """Joint torques, N m, shape (samples, joints)."""


class Samples(NamedTuple):
    """Samples of an exciting motion."""

    t: NDArray[np.float64]
    """Time, s, shape (samples,)."""
    q: NDArray[np.float64]
    """Joint angles, rad, shape (samples, joints)."""
    qd: NDArray[np.float64]
    """Joint speeds, rad/s, shape (samples, joints)."""
    qdd: NDArray[np.float64]
    """Joint accelerations, rad/s2, shape (samples, joints)."""


class Prediction(NamedTuple):
    """Torque predicted by an accepted model."""

    tau: NDArray[np.float64]
    """Torque, N m, shape (samples, joints)."""
    sigma: NDArray[np.float64]
    """Standard deviation of the torque by that of the parameters, N m, shape (samples, joints)."""


class Parameter(NamedTuple):
    """One of the fourteen parameters of a joint."""

    value: float | None
    """Value in `unit`; None if neither torque nor a prior determines it."""
    sigma: float | None
    """Standard deviation; None unless the parameter is identified alone."""
    unit: str
    status: str
    """'identified', 'grouped', 'weak' or 'prior'."""


class Curves(NamedTuple):
    """Curves of one motion behind the filter of the identification, 50 rows a second."""

    name: str
    role: str
    """'identified from', or 'unused, predicted'."""
    time_s: NDArray[np.float64]
    """Shape (rows,)."""
    angle_deg: NDArray[np.float64]
    """Measured angles, degrees, shape (rows, joints)."""
    measured_nm: NDArray[np.float64]
    """Measured torque, filtered, N m, shape (rows, joints)."""
    predicted_nm: NDArray[np.float64]
    """Torque predicted by the result, filtered, N m, shape (rows, joints)."""
    at_rest: NDArray[np.bool_]
    """Rows that are excluded because the joint is at rest, shape (rows, joints)."""


class Simulation(NamedTuple):
    """Run of a simulated leg with the firmware's servo and identification."""

    recording: Recording
    """Motion that is identified from, as the drive logged it: 500 samples a second, with noise."""
    validation: list[Recording]
    """Motions that are only predicted."""
    identification: Identification
    """Result of the firmware."""


class Minimum(NamedTuple):
    """Result of a search."""

    x: NDArray[np.float64]
    """Best position, shape (coordinates,)."""
    value: float
    """Objective there."""
    evaluations: int
    iterations: int

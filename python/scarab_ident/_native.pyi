"""Shapes: a row for each sample, a column for each joint; `(joints,)` for a single sample. Units: rad, rad/s,
rad/s2, N m, s. Functions raise `InputError` for a value or a file that cannot be used, and `TypeError` for a value
of another type. Docstrings of the module are taken from here (build.rs)."""

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, SupportsFloat, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._records import Curves, Minimum, Parameter, Prediction, Recording, Samples, Simulation

__all__ = [
    "Identification",
    "InputError",
    "Leg",
    "Motion",
    "RefusedError",
    "beetle_swarm",
    "read_recording",
]

_Path = str | PathLike[str]
_Array = NDArray[np.float64]
_Triple = tuple[ArrayLike, ArrayLike, ArrayLike]

class InputError(ValueError):
    """An argument or a file cannot be used; the message says what is wrong, where, and what to do."""

class RefusedError(RuntimeError):
    """A model that was refused cannot be used; the message holds the reasons of the verdict."""

@final
class Leg:
    """Leg of 1 to 3 joints: geometry (modified Denavit-Hartenberg), gravity, limits, and prior where known."""

    @staticmethod
    def from_toml(path: _Path) -> Leg:
        """Reads a leg file (docs/files.md), or a shipped leg by name, such as 'mujoco-leg'."""

    @staticmethod
    def from_urdf(
        path: _Path,
        joints: Sequence[str] | None = None,
        *,
        locked: Mapping[str, float] | None = None,
        gravity: Sequence[float] | None = None,
        parallel_rad: float = 0.0,
        prior: bool = True,
    ) -> Leg:
        """Converts a robot description.

        `joints`: the leg's joints, proximal first; default all that turn. `locked`: position of each joint that
        is held, rad or m. `gravity`: m/s2 in the frame of the root, default (0, 0, -9.81). `parallel_rad`: axes within this angle count
        as parallel, 0 to 0.01. `prior=False` leaves out the bodies. See also `remarks`.
        """

    @staticmethod
    def from_text(toml: str) -> Leg:
        """Reads the text of a leg file."""

    @property
    def name(self) -> str:
        """Name in the leg file."""

    @property
    def joints(self) -> list[str]:
        """Names of the joints, proximal first."""

    @property
    def toml(self) -> str:
        """Text of the leg file."""

    @property
    def remarks(self) -> list[str]:
        """What a robot description states and the leg file does not hold."""

    @property
    def parameter_names(self) -> list[str]:
        """Names of the 14 parameters of each joint, such as 'XX1': the columns of `regressor`.

        XX..ZZ: inertia tensor about the frame's origin, kg m2; HX..HZ: first moment, kg m; M: mass, kg; IA: rotor
        inertia, kg m2; FC: Coulomb friction, N m; FV: viscous friction, N m s/rad; OFF: offset, N m. Where the leg
        file estimates another Coulomb friction for each direction, results name the last one FCA.
        """

    def save(self, path: _Path) -> None:
        """Writes the leg file; a file that exists is refused."""

    def parameters(self, of: Literal["truth", "prior"] | None = None) -> _Array:
        """Parameters that the leg file states, shape (14 joints,); default: truth, else prior."""

    def regressor(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, inertial_only: bool = False, dh: bool = False
    ) -> _Array:
        """Regressor Y of each state: `Y @ parameters` is the torque.

        Shape (samples, joints, 14 joints); with `inertial_only` the ten inertial parameters of each link,
        (samples, joints, 10 joints). `dh`: angles and torques of the D-H frames instead of anatomical ones.
        Source: Khalil and Dombre, Modeling, Identification and Control of Robots (2002), ch. 9.
        """

    def inverse_dynamics(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        *,
        parameters: ArrayLike | None = None,
        of: Literal["truth", "prior"] | None = None,
        dh: bool = False,
    ) -> _Array:
        """Torque of each state, shape (samples, joints): bodies by Newton-Euler, rotors, Coulomb and viscous
        friction, offset. Stribeck friction and a difference between the directions are not included.

        `parameters`: 14 for each joint; default those of the leg file, as in `parameters(of)`.
        """

    def identify(
        self,
        t: ArrayLike,
        q: ArrayLike,
        tau: ArrayLike,
        *,
        also: _Triple | Sequence[_Triple] | None = None,
        validate: _Triple | Sequence[_Triple] | None = None,
        split: float | None = None,
        bandwidth_hz: float | Literal["auto"] | None = None,
        accept_error_percent: float | None = None,
        plan: Literal["one-time", "sequential"] = "one-time",
        prior: str | None = None,
        estimator: Literal["robust", "plain"] = "robust",
        seed: int = 1,
        torque_delay_ms: float | Sequence[float] | None = None,
        even_stamps: bool = False,
        load: str | None = None,
        payload: str | None = None,
        with_payload: _Triple | Sequence[_Triple] | None = None,
        temperature_c: float | None = None,
    ) -> Identification:
        """Identifies the leg from recordings, with the firmware's filters, estimate, swarm and verdict.

        `t`: (samples,), strictly increasing, 10 Hz or faster; `q` and `tau`: (samples, joints). A message about
        `recording:17` concerns sample 17. `also`: more training recordings (t, q, tau). `validate`: held-out
        recordings; `split`: share of each recording that trains. Without either, the result is not validated.
        `bandwidth_hz`: -3 dB frequency of the low-pass, default that of the leg file (8 Hz).
        `accept_error_percent`: error accepted beside noise, percent of the rms torque, default that of the leg
        file (5). `prior`: 'none', 'file' or 'wrong:PERCENT'. `torque_delay_ms`: delay to be removed, one value or one for each joint.
        `load`, `payload`: known mass as 'KG@JOINT:X_M', see `cargo sim replay --help`.
        A recording that cannot be identified from still gives a result, whose verdict refuses it with reasons.
        """

    def excite(
        self,
        *,
        duration_s: float = 22.0,
        seed: int = 1,
        evaluations: int = 48_000,
        torque_noise_percent: float | None = None,
        torque_margin_percent: float = 20.0,
        assume_truth: bool = False,
    ) -> Motion:
        """Designs a motion that makes all parameters visible within the limits of the leg.

        Needs `prior` or `truth` of every joint and a noise of the torque, percent of the mean absolute torque.
        Ctrl-C acts at the end of the design.
        """

    def simulate(
        self,
        *,
        motion: Motion | None = None,
        seed: int = 1,
        torque_noise_percent: float | None = None,
        drive: Literal["ideal", "full"] = "ideal",
    ) -> Simulation:
        """Drives and identifies a simulated leg (needs `truth`) with the firmware."""

@final
class Identification:
    """Result of an identification. `print(result)` shows the tables of `cargo sim replay`."""

    @property
    def accepted(self) -> bool:
        """Whether the verdict accepts the result."""

    @property
    def validated(self) -> bool:
        """Whether unused motions were predicted."""

    @property
    def verdict(self) -> str:
        """Verdict in one line."""

    @property
    def reasons(self) -> list[str]:
        """Reasons of a refusal (docs/method.md, verdict)."""

    @property
    def warnings(self) -> list[str]:
        """Doubts that do not change the result."""

    @property
    def bandwidth_hz(self) -> float:
        """Frequency at which the filter's low-pass is 3 dB down, Hz."""

    @property
    def names(self) -> list[str]:
        """Names of the k base parameters: the combinations that torque determines."""

    @property
    def units(self) -> list[str]:
        """Their units."""

    @property
    def values(self) -> _Array:
        """Base parameters, shape (k,)."""

    @property
    def sigma(self) -> _Array:
        """Their standard deviations, shape (k,)."""

    @property
    def covariance(self) -> _Array:
        """Their covariance, shape (k, k)."""

    @property
    def sums(self) -> _Array:
        """Factors of the combinations, shape (k, 14 joints), columns in the order of `parameters`:
        `sums @ leg.parameters()` are the base parameters of a leg with these parameters."""

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The 14 parameters of each joint, with their status."""

    @property
    def motions(self) -> list[Curves]:
        """Measured and predicted torque of each motion."""

    @property
    def report(self) -> dict[str, Any]:
        """Everything, as `cargo sim replay --json` writes it (docs/files.md)."""

    def predict(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, dh: bool = False) -> Prediction:
        """Torque of each state with its standard deviation. Raises `RefusedError` unless accepted."""

    def save(self, path: _Path) -> None:
        """Writes the model file that `cargo sim predict` reads. Raises `RefusedError` unless accepted.

        An older model file is replaced; a file of another kind is not.
        """

    def write_report(self, path: _Path) -> None:
        """Writes the HTML page of figures, tables and verdict. An older page is replaced; another file is not."""

    def plot(self, joint: str | None = None) -> NDArray[np.object_]:
        """Draws measured and predicted torque and their difference with matplotlib, for all joints or one.

        Returns the axes, shape (2, joints); `axes[0, 0].figure` is the figure.
        """

@final
class Motion:
    """Exciting motion of a leg, from rest to rest."""

    @staticmethod
    def load(path: _Path, leg: Leg) -> Motion:
        """Reads a motion file; a motion of another leg or beyond this leg's limits is refused."""

    @property
    def duration_s(self) -> float:
        """Duration with its blends, s."""

    @property
    def report(self) -> dict[str, Any] | None:
        """Expected standard deviations and limits of a design; None for a motion from a file."""

    def samples(self, rate_hz: int = 500) -> Samples:
        """States at a divisor of 4000 Hz."""

    def to_trajectory(self, rate_hz: int = 500) -> str:
        """YAML of a ROS 2 trajectory_msgs/JointTrajectory."""

    def save(self, path: _Path) -> None:
        """Writes the motion file that `cargo sim identify --excitation` reads.

        An older motion file is replaced; a file of another kind is not.
        """

def read_recording(
    path: _Path,
    leg: Leg,
    *,
    columns: str = "",
    units: str = "",
    skip_bad: bool = False,
    rate_hz: float | None = None,
    merge_rows: bool = False,
    even_stamps: bool = False,
    delimiter: Literal["comma", "semicolon", "tab", "space"] | None = None,
    decimal: Literal["point", "comma"] | None = None,
) -> Recording:
    """Reads a CSV recording (also .csv.gz), as `cargo sim replay` does.

    `columns`: 't=time,q1=position_0,tau1=4'; `units`: 'ms,deg,tau2=mNm'. Nothing is converted unless stated.
    `skip_bad` skips invalid rows, at most 5 %, with a warning. `rate_hz` reads rows without times, `merge_rows`
    rows that hold some of the signals each; `even_stamps` replaces the times. Other formats: `pandas`, then arrays.
    """

def beetle_swarm(
    objective: Callable[[NDArray[np.float64]], SupportsFloat],
    bounds: ArrayLike,
    *,
    evaluations: int = 20_000,
    goal: float | None = None,
    seed: int = 1,
    rules: Literal["adaptive", "paper"] = "adaptive",
) -> Minimum:
    """Minimises a function over a box of at most 64 coordinates with the firmware's swarm of 20 beetles.

    `bounds`: lowest and highest value of each coordinate, shape (coordinates, 2). `objective` gets an array of
    shape (coordinates,); a value that is not finite drops the candidate. The search ends after `evaluations`, or
    at `goal`. An exception of the objective ends it. The same seed gives the same result. Method: docs/bso.md;
    `rules='paper'` are the printed equations with (29) corrected.
    """

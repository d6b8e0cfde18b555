"""Writes the files of this folder with foreign software: pyarrow, rosbags, SciPy.

    python -m venv venv && venv/bin/pip install pyarrow rosbags scipy
    venv/bin/python make.py

Sample k of 120: time k / 64 s, angle 0.5 sin(3 t) rad, torque 4 - k / 8 N m; the second joint has twice of both.
"""

import math
import pathlib
import shutil
import tempfile

import numpy
import pyarrow
import pyarrow.parquet
import scipy.io
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode
from rosbags.typesys import Stores, get_typestore

here = pathlib.Path(__file__).parent
samples = range(120)
time = [k / 64 for k in samples]
angle = [0.5 * math.sin(3 * t) for t in time]
torque = [4 - k / 8 for k in samples]

# Parquet: time stamps in nanoseconds, a torque in single precision with a missing value, a column of text.
table = pyarrow.table(
    {
        "stamp": pyarrow.array([int(t * 1e9) for t in time], pyarrow.timestamp("ns")),
        "time": time,
        "q1_rad": angle,
        "tau1_Nm": pyarrow.array([None if k == 7 else value for k, value in enumerate(torque)], pyarrow.float32()),
        "count": pyarrow.array(samples, pyarrow.uint16()),
        "note": ["up"] * len(time),
    }
)
for codec in ("snappy", "zstd", "lz4", "gzip"):
    # Small row groups and pages: several of each.
    pyarrow.parquet.write_table(table, here / f"{codec}.parquet", compression=codec, row_group_size=50, data_page_size=128)

# rosbag2 with MCAP storage: states of two joints, their order reversed from message 60 on, among another topic.
store = get_typestore(Stores.ROS2_HUMBLE)
JointState = store.types["sensor_msgs/msg/JointState"]
Header = store.types["std_msgs/msg/Header"]
Stamp = store.types["builtin_interfaces/msg/Time"]
String = store.types["std_msgs/msg/String"]
for name, mode in (("plain", None), ("zstd", CompressionMode.STORAGE)):
    folder = pathlib.Path(tempfile.mkdtemp()) / "bag"
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    if mode:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        states = writer.add_connection("/joint_states", JointState.__msgtype__, typestore=store)
        chatter = writer.add_connection("/chatter", String.__msgtype__, typestore=store)
        for k in samples:
            names = ["knee_joint", "hip_joint"] if k >= 60 else ["hip_joint", "knee_joint"]
            scale = numpy.array([2.0, 1.0] if k >= 60 else [1.0, 2.0])
            nanoseconds = int(time[k] * 1e9)
            message = JointState(
                Header(Stamp(1700000000 + nanoseconds // 10**9, nanoseconds % 10**9), "base"),
                names, angle[k] * scale, numpy.array([]), torque[k] * scale,
            )
            writer.write(states, nanoseconds, store.serialize_cdr(message, JointState.__msgtype__))
            writer.write(chatter, nanoseconds, store.serialize_cdr(String("up"), String.__msgtype__))
    shutil.copy(next(folder.glob("*.mcap")), here / f"{name}.mcap")
    shutil.rmtree(folder.parent)

# MAT files are refused with a sentence.
scipy.io.savemat(here / "level5.mat", {"t": numpy.array(time[:3])})

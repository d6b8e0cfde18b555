//! Files that are not CSV, by their first bytes: read with the feature `readers`, or refused with the way to
//! a file that is read.

use scarab_base::error::FileError;
use std::path::Path;

use crate::formats::recording::columns::refuse;
use crate::formats::recording::decode::Read;
use crate::formats::recording::fault::Fault;
use crate::formats::recording::import::Import;

/// Kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Foreign {
    Parquet,
    Mcap,
    /// What the file is, and what to do.
    Refused(&'static str),
}

const MATLAB: &str = "a MAT file, which is not read: save the columns as CSV, in MATLAB \
    writetable(table(t, q1, tau1), 'run.csv'), in Python scipy.io.loadmat and numpy.savetxt";

/// First bytes of an SQLite file.
const SQLITE: &[u8] = b"SQLite format 3\0";

/// First bytes of each kind.
const KINDS: [(&[u8], Foreign); 11] = [
    (b"PAR1", Foreign::Parquet),
    (b"\x89MCAP0\r\n", Foreign::Mcap),
    (b"MATLAB 5.0", Foreign::Refused(MATLAB)),
    (b"MATLAB 7.3", Foreign::Refused(MATLAB)),
    (
        b"\x89HDF\r\n",
        Foreign::Refused(
            "an HDF5 file, which is not read: save the columns as CSV or Parquet, in Python h5py and pandas",
        ),
    ),
    (
        SQLITE,
        Foreign::Refused(
            "an SQLite file, as older bags of ROS 2 are: convert the bag's folder to MCAP by \
             `rosbags-convert --src BAG --dst NEW --dst-storage mcap`",
        ),
    ),
    (
        b"#ROSBAG V",
        Foreign::Refused(
            "a bag of ROS 1: convert it to MCAP by `rosbags-convert --src run.bag --dst NEW --dst-storage mcap`",
        ),
    ),
    (b"\x93NUMPY", Foreign::Refused("a NumPy array: save it as CSV by numpy.savetxt with delimiter=','")),
    (b"PK\x03\x04", Foreign::Refused("a ZIP archive, as .xlsx and .npz are: save the columns as CSV")),
    (b"\x28\xB5\x2F\xFD", Foreign::Refused("packed by Zstandard: unpack it by `zstd -d`")),
    (b"BZh", Foreign::Refused("packed by bzip2: unpack it by `bunzip2`")),
];

impl Foreign {
    /// Kind of a file that begins with these bytes.
    pub(crate) fn detect(begin: &[u8]) -> Option<Self> {
        KINDS.into_iter().find(|(bytes, _)| begin.starts_with(bytes)).map(|(_, kind)| kind)
    }

    /// Kind of a folder that holds a bag of ROS 2.
    pub(crate) fn detect_folder(folder: &Path) -> Option<Self> {
        let names = std::fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.path()));
        let extensions: Vec<_> = names.filter_map(|path| path.extension().map(ToOwned::to_owned)).collect();
        let has = |wanted: &str| extensions.iter().any(|extension| extension == wanted);
        match (has("mcap"), has("db3")) {
            (true, _) => Some(Self::Mcap),
            (false, true) => Self::detect(SQLITE),
            _ => None,
        }
    }

    /// Reads or refuses the file.
    pub fn read(self, file: &Path, is_packed: bool, import: &Import) -> Result<Read, FileError> {
        let refused = |reason: &str| Err(refuse(file, None, Fault::Unreadable(reason.to_owned())));
        match self {
            Self::Refused(reason) => refused(reason),
            _ if is_packed => refused("packed by gzip: unpack it by `gunzip`"),
            #[cfg(feature = "readers")]
            Self::Parquet | Self::Mcap => readers::read(self, file, import),
            #[cfg(not(feature = "readers"))]
            Self::Parquet | Self::Mcap => {
                let _ = import;
                let kind = if self == Self::Parquet { "a Parquet file" } else { "an MCAP file" };
                refused(&format!(
                    "{kind}, which this program is built without: in the clone give the same command with `cargo sim-readers` \
                     instead of `{}`; an installed program needs `cargo install --path host/tool --features readers`",
                    scarab_base::shell::program()
                ))
            }
        }
    }
}

#[cfg(feature = "readers")]
mod readers {
    use std::ops::ControlFlow;
    use std::path::Path;

    use scarab_readers::Table;
    use scarab_readers::mcap::Mcap;
    use scarab_readers::parquet::Parquet;

    use super::Foreign;
    use crate::formats::recording::chosen::Names;
    use crate::formats::recording::columns::refuse;
    use crate::formats::recording::decode::{Decoder, Read};
    use crate::formats::recording::fault::Fault;
    use crate::formats::recording::import::Import;
    use crate::formats::recording::signal::Unit;
    use crate::formats::recording::source;
    use scarab_base::error::FileError;

    /// Steps of the progress bar.
    const STEPS: u64 = 1000;

    pub(super) fn read(kind: Foreign, file: &Path, import: &Import) -> Result<Read, FileError> {
        let refused = |error: scarab_readers::Error| refuse(file, None, Fault::Unreadable(error.to_string()));
        let (table, format): (Box<dyn Table>, _) = match kind {
            Foreign::Mcap => {
                (Box::new(Mcap::open(file).map_err(refused)?), "MCAP, sensor_msgs/msg/JointState")
            }
            _ => (Box::new(Parquet::open(file).map_err(refused)?), "Parquet"),
        };
        let names = Names {
            names: table.columns().iter().map(|column| column.name.clone()).collect(),
            units: table.columns().iter().map(|column| column.unit.and_then(Unit::named)).collect(),
            are_stated: true,
        };
        let mut decoder = Decoder::new(file, &names, import).map_err(|fault| refuse(file, None, fault))?;
        let progress = source::progress(file, STEPS, "{percent} %");
        let mut failure = None;
        let chosen = decoder.indices();
        table
            .read(&chosen, &mut |row| {
                progress.set_position((row.done * STEPS as f64) as u64);
                let mut values = row.values.iter();
                let number = usize::try_from(row.number).unwrap_or(usize::MAX);
                let taken = decoder
                    .take(number, |column| column.column.finite(values.next().copied().unwrap_or(f64::NAN)));
                match taken {
                    Ok(()) => ControlFlow::Continue(()),
                    Err(error) => {
                        failure = Some(error);
                        ControlFlow::Break(())
                    }
                }
            })
            .map_err(refused)?;
        progress.finish_and_clear();
        match failure {
            Some(error) => Err(error),
            None => decoder.finish(format.to_owned(), true),
        }
    }
}

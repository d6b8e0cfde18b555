//! Options that state how recordings are read.

use clap::Args;

use crate::cli::arguments::{Choice, one_of};
use scarab_base::error::ToolError;
use scarab_base::names::BY_CARGO;
use scarab_base::shell::{program_of, quoted};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::recording::dialect::{Decimal, Delimiter};
use scarab_identify::formats::recording::import::{ColumnChoice, Import, UnitChoice};

/// Columns, units and format of all recordings of the command.
#[derive(Args, Debug)]
pub(crate) struct ImportArguments {
    /// Columns by name or number from 1: SIGNAL=COLUMN,.. with the signals t, q1.. (joint angle) or motor1..
    /// (motor angle), tau1.. (joint torque) or i1.. (motor current). Example: t=time,q1=position_0,tau1=4
    #[arg(long, value_name = "SIGNAL=COLUMN,..", value_delimiter = ',', help_heading = "Recordings")]
    columns: Vec<ColumnChoice>,
    /// Units: UNIT,.. for all signals of a quantity, SIGNAL=UNIT for one; s, ms, us, ns, rad, mrad, deg,
    /// turn, Nm, mNm, A, mA. Default: s, rad, Nm, A. Example: ms,deg,tau2=mNm
    #[arg(long, value_name = "UNIT,..", value_delimiter = ',', help_heading = "Recordings")]
    units: Vec<UnitChoice>,
    /// Skip rows that are invalid, at most 5 % of a file; they are counted and reported.
    #[arg(long, help_heading = "Recordings")]
    skip_bad: bool,
    /// Rate of the rows of files without a column of time, Hz.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, help_heading = "Recordings")]
    rate: Option<f64>,
    /// Join rows that hold some of the signals each, as loggers of messages write them, by time.
    #[arg(long, conflicts_with = "rate", help_heading = "Recordings")]
    merge_rows: bool,
    /// Replace the time stamps by an even clock from the first to the last.
    #[arg(long, help_heading = "Recordings")]
    even_stamps: bool,
    /// Separator of fields, where the first lines allow two.
    #[arg(long, value_parser = one_of(DELIMITERS), help_heading = "Recordings")]
    delimiter: Option<Delimiter>,
    /// Decimal sign, where the first lines allow two.
    #[arg(long, value_parser = one_of(DECIMALS), help_heading = "Recordings")]
    decimal: Option<Decimal>,
}

const DELIMITERS: &[Choice<Delimiter>] = &[
    ("comma", Delimiter::Comma, ""),
    ("semicolon", Delimiter::Semicolon, ""),
    ("tab", Delimiter::Tab, ""),
    ("space", Delimiter::Space, ""),
];

const DECIMALS: &[Choice<Decimal>] = &[("point", Decimal::Point, ""), ("comma", Decimal::Comma, "")];

impl ImportArguments {
    /// How to read the recordings of this leg. `name` is the leg's name or file.
    pub fn import(&self, leg: &LegFile, name: &str) -> Result<Import, ToolError> {
        let (text, _) = LegFile::text(name)?;
        let import = Import {
            skip_bad: self.skip_bad,
            rate_hz: self.rate,
            merge_rows: self.merge_rows,
            even_stamps: self.even_stamps,
            delimiter: self.delimiter,
            decimal: self.decimal,
            command: command(std::env::args_os().map(|word| word.to_string_lossy().into_owned())),
            ..Import::from_leg(leg, &text)
        };
        import.with(&self.columns, &self.units).map_err(ToolError::input)
    }
}

/// The command as typed, without `--columns` and `--units`.
fn command(words: impl Iterator<Item = String>) -> String {
    let words: Vec<String> = words.collect();
    let mut command = program_of(words.iter().cloned());
    let mut words = words.into_iter().skip(1).filter(|word| word != BY_CARGO);
    while let Some(word) = words.next() {
        if word == "--columns" || word == "--units" {
            words.next();
        } else if !word.starts_with("--columns=") && !word.starts_with("--units=") {
            command.push(' ');
            command.push_str(&quoted(&word));
        }
    }
    command
}

#[cfg(test)]
mod tests {
    use super::{BY_CARGO, command};
    use scarab_base::shell::ALIAS;

    #[test]
    fn a_proposed_command_keeps_all_other_options() {
        let typed = [
            "target/scarab",
            BY_CARGO,
            "replay",
            "my run.csv",
            "--columns",
            "t=a",
            "--units=ms",
            "--split",
            "0.7",
        ];
        assert_eq!(
            command(typed.into_iter().map(str::to_owned)),
            format!("{ALIAS} replay 'my run.csv' --split 0.7")
        );
        assert_eq!(command(["scarab", "replay"].into_iter().map(str::to_owned)), "scarab replay");
    }
}

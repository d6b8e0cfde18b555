//! Leg with its wearer, side and trunk.

use clap::Args;
use scarab_base::error::ToolError;
use scarab_base::shell::program;
use scarab_identify::formats::leg_file::{BodySide, DEFAULT_LEG, LegFile, SHIPPED_LEGS};
use scarab_identify::leg::posture::{on_side, pitched};
use scarab_identify::leg::size::{Person, Size};

use crate::cli::arguments::{Choice, LegName, one_of};

/// Sides of the body.
const SIDES: &[Choice<BodySide>] = &[
    ("left", BodySide::Left, "Drives mounted mirrored"),
    ("right", BodySide::Right, "Drives mounted as described"),
];

/// Leg and its settings.
#[derive(Args, Clone, Debug)]
pub(crate) struct LegOptions {
    /// Name of a shipped leg, or a leg file. Default: x2-wearer-75kg; predict and export: the model's leg.
    /// Replay and flash-leg require it.
    #[arg(long)]
    leg: Option<LegName>,
    /// Length of the thigh, m (0.402 to 0.505).
    #[arg(long, value_name = "M", allow_negative_numbers = true, help_heading = "Simulated wearer")]
    thigh: Option<f64>,
    /// Length of the shank, m (0.397 to 0.506).
    #[arg(long, value_name = "M", allow_negative_numbers = true, help_heading = "Simulated wearer")]
    shank: Option<f64>,
    /// Body mass, kg, and height, m, of the wearer; the height sets the lengths not given.
    #[arg(long, value_name = "KG,M", help_heading = "Simulated wearer")]
    wearer: Option<Person>,
    /// Side of the body. Default: that of the leg file.
    #[arg(long, value_parser = one_of(SIDES), help_heading = "Simulated wearer")]
    side: Option<BodySide>,
    /// Angle by which the trunk leans forward, degrees; the firmware gets it too.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, help_heading = "Simulated wearer")]
    trunk_pitch: Option<f64>,
}

impl LegOptions {
    /// Rejects a command line without a leg; `example` shows a correct one.
    pub(crate) fn require(&self, example: &str) -> Result<(), ToolError> {
        if self.leg.is_some() {
            return Ok(());
        }
        let names = SHIPPED_LEGS.map(|(name, _)| name).join(", ");
        Err(ToolError::input(format!(
            "--leg is missing: of which leg? For example `{} {example}`, where my-leg.toml is a leg file (docs/files.md); \
             shipped legs go by their names: {names}",
            program()
        )))
    }

    /// Loads the leg with its settings; changes become part of its name.
    pub fn load(&self) -> Result<LegFile, ToolError> {
        self.set(LegFile::load(self.name())?)
    }

    /// Loads the leg of an image; its file must state every key of the machine.
    pub(crate) fn load_for_image(&self) -> Result<LegFile, ToolError> {
        self.set(LegFile::load_for_image(self.name(), self.side.is_some())?)
    }

    /// Name of the shipped leg, or path of the leg file.
    pub fn name(&self) -> &str {
        self.leg.as_deref().unwrap_or(DEFAULT_LEG)
    }

    fn set(&self, mut leg: LegFile) -> Result<LegFile, ToolError> {
        let mut changes = Vec::new();
        let size = Size { thigh: self.thigh, shank: self.shank, wearer: self.wearer };
        leg = size.apply_to(&leg)?;
        changes.extend(self.thigh.map(|length| format!(" --thigh {length}")));
        changes.extend(self.shank.map(|length| format!(" --shank {length}")));
        changes.extend(self.wearer.map(|person| format!(" --wearer {},{}", person.mass, person.height)));
        if let Some(side) = self.side.filter(|side| *side != leg.side) {
            leg = on_side(&leg, side)?;
            changes.push(format!(" --side {}", if side == BodySide::Left { "left" } else { "right" }));
        }
        if let Some(degrees) = self.trunk_pitch {
            leg = pitched(&leg, degrees)?;
            changes.push(format!(" --trunk-pitch {degrees}"));
        }
        leg.name.extend(changes);
        Ok(leg)
    }
}

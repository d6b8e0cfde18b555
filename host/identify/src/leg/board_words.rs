//! Describes rejections and faults of the firmware's axes, with the key of the leg file that corrects them.

use scarab::motor::{AxisError, AxisFault, Mismatch, MotorConstant, Phase, Refusal};

/// Reason why the firmware rejects an axis configuration.
pub fn axis_error(error: AxisError) -> String {
    let words = match error {
        AxisError::Sense => "the scales of amplifiers, converter or bus divider are implausible",
        AxisError::Timing => "dead time, settling and conversion leave less than half of a PWM period",
        AxisError::Encoder => {
            "the encoder needs 16 to 65,536 counts (`encoder.counts`) and more than four per pole pair (`motor.pole_pairs`)"
        }
        AxisError::Speed => {
            "at twice the speed limit (`speed_limit_deg_s`) the rotor would turn by a twelfth of an electrical turn per PWM period"
        }
        AxisError::Motor => {
            "no current loop can be designed for this flux, resistance or inductance (`torque_per_ampere`, `motor`)"
        }
        AxisError::Current => {
            "its current limit (`current_limit_a`, or torque_limit_nm / torque_per_ampere) must be below the 61 A at which the bridge turns off"
        }
        AxisError::Bus => "the limits of the bus voltage exceed the range of the divider",
        AxisError::BackEmf => {
            "at twice the speed limit the back-EMF of a motor with its bridge off exceeds the largest bus voltage of 58 V: lower `speed_limit_deg_s`, `torque_per_ampere` or `encoder.ratio`"
        }
        AxisError::Calibration => "its calibration was made for another configuration",
    };
    format!("the firmware rejects its configuration: {words}")
}

/// Reason for a failed calibration.
pub fn refusal(reason: Refusal) -> String {
    let words = match reason {
        Refusal::Overcurrent => "the current went beyond 61 A".to_owned(),
        Refusal::CurrentSense => "a shunt amplifier is at its rail".into(),
        Refusal::BusVoltage => {
            "the bus voltage left 20 V..58 V (`supply.voltage_v`, `supply.resistance_ohm`)".into()
        }
        Refusal::ShuntOffset(phase) => {
            format!("the shunt of phase {} has too large an offset, or too much noise", name(phase))
        }
        Refusal::Turning => "the rotor turns although the bridge is off".into(),
        Refusal::PhaseOpen(phase) => format!("no current flows in phase {}", name(phase)),
        Refusal::ShuntInverted(phase) => format!("the shunt of phase {} reads with the wrong sign", name(phase)),
        Refusal::ShuntsInverted => "both shunts read with the wrong sign".into(),
        Refusal::ShuntsSwapped => "the shunts of phases B and C are exchanged".into(),
        Refusal::CurrentDirection => "currents do not flow in the direction of the voltage".into(),
        Refusal::PhaseImbalance => "the phases' resistances differ by more than 15 %".into(),
        Refusal::MotorConstants => {
            "resistance or inductance is out of range, or too large for 9.5 V at the calibration's current (`motor.resistance_ohm`, `motor.inductance_d_uh`, `motor.inductance_q_uh`)".into()
        }
        Refusal::OtherMotor(constant, mismatch) => other_motor(constant, mismatch),
        Refusal::Flux(Mismatch { stated, found }) => format!(
            "the back-EMF shows a flux linkage of {found:.3e} V s, stated {stated:.3e}, limit 25 %: check \
             `torque_per_ampere`, `motor.pole_pairs` and `encoder.ratio`"
        ),
        Refusal::TimeOut => "the current does not settle".into(),
        Refusal::NoCounts => "the field turned, but the counter did not: check the encoder, or whether the rotor is blocked".into(),
        Refusal::Direction => {
            "the counter runs against the field: two motor leads or the encoder's A and B are exchanged".into()
        }
        Refusal::PolePairs { stated, found } => {
            format!("the counts fit {found} pole pairs, stated {stated} (`motor.pole_pairs`)")
        }
        Refusal::CountsPerTurn { stated, found } => {
            format!("the counts fit {found} per turn, stated {stated} (`encoder.counts`)")
        }
        Refusal::Slipped => {
            "the rotor did not follow the field evenly: load, friction or cogging (`motor.cogging_nm`) need more than half of the holding torque".into()
        }
        Refusal::Load(percent) => format!(
            "the load takes {percent} % of the torque that the calibration's current holds, at most 60 are permitted: \
             calibrate in a pose with less load, such as with the leg hanging"
        ),
        Refusal::Travel => {
            "the rotor moved further than a calibration may: a load tore it away, or it has fewer pole pairs than \
             configured (`motor.pole_pairs`)".into()
        }
        Refusal::NoIndex => "no index pulse within a whole turn".into(),
        Refusal::IndexMoved => "the index pulse came at different positions of the turn".into(),
        Refusal::StoredOffset(Mismatch { stated, found }) => {
            format!("the offset is {found:.4} electrical turns, stored {stated:.4}, limit 5 degrees")
        }
        Refusal::Moved => {
            "the rotor moved while the field lay along its flux: the stored offset or the index is wrong, a phase \
             is open, or the joint was pushed; the next calibration turns the motor".into()
        }
    };
    format!("the calibration is refused: {words}")
}

/// Motor constant that is not the stored one.
fn other_motor(constant: MotorConstant, Mismatch { stated, found }: Mismatch) -> String {
    let (constant, limit) = match constant {
        MotorConstant::Resistance => ("resistance (ohm)", 40),
        MotorConstant::DirectInductance => ("inductance along the flux (H)", 20),
        MotorConstant::QuadratureInductance => ("inductance across the flux (H)", 20),
    };
    format!("the {constant} is {found:.3e}, stored {stated:.3e}, limit {limit} %: another motor")
}

const fn name(phase: Phase) -> &'static str {
    match phase {
        Phase::A => "A",
        Phase::B => "B",
        Phase::C => "C",
    }
}

/// Reason why an axis switched its bridge off.
pub const fn axis_fault(fault: AxisFault) -> &'static str {
    match fault {
        AxisFault::CurrentSense => "a shunt amplifier stayed at its rail",
        AxisFault::Overcurrent => "the current went beyond 61 A",
        AxisFault::BusVoltage => "the bus voltage left 20 V..58 V (`supply`)",
        AxisFault::Encoder => {
            "its counts jumped or the index came at another position: the rotor's angle is lost"
        }
        AxisFault::NotANumber => "a current or voltage was not finite",
        AxisFault::EncoderFrozen => "the counter is constant although the motor turns",
        AxisFault::OpenPhase => "a phase has voltage but no current",
        AxisFault::CurrentOffset => "a shunt's offset drifted",
        AxisFault::Parameters => "its gains or limits changed in memory",
        AxisFault::StuckConversion => "a shunt's code does not change with its current",
    }
}

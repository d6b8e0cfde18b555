//! All records of the trace.
//!
//! The list is written once. The firmware makes [`Record`] of it: with `defmt` the device sends index and
//! values, without it [`Record::write`] fills the format in. A reader declares its own types from the same
//! list with `trace_records!`, at no cost to the image.
//!
//! `defmt` takes a format as a literal only, so a format stands beside its fields. The compiler refuses one
//! whose keys or types are not those of the fields. The record's number comes first. Fields behind `+` were
//! added later: traces of older images lack them.

use core::fmt::{self, Write};

use super::definition::records;
use super::fill::{Hint, Value, fill, is_format_of};

/// Passes the list of all records to a macro.
#[macro_export]
macro_rules! trace_records {
    ($list:ident) => { $list! {
    /// The image has started.
    Boot "boot n={=u32} grammar={=u8} version={=str} leg={=str} joints={=u8} base={=u8} servo_hz={=u32} log_hz={=u32} reset={=str}" {
        /// Version of the grammar, `GRAMMAR`.
        grammar: u8,
        /// Firmware version.
        version: &'static str,
        /// Name of the leg that the image is built for.
        leg: &'static str,
        /// Number of joints.
        joints: u8,
        /// Number of base parameters.
        base: u8,
        /// Servo ticks per second.
        servo_hz: u32,
        /// Logged samples per second.
        log_hz: u32,
        /// Cause of the last reset.
        reset: &'static str,
    }
    /// Board identity and clock.
    Board "board n={=u32} uid0={=u32:#x} uid1={=u32:#x} uid2={=u32:#x} version={=u8} version_minor={=u8} version_volt={=u8} clock_hz={=u32} brown_out={=u8}" {
        /// Lowest word of the chip's unique number.
        uid0: u32,
        /// Middle word of the unique number.
        uid1: u32,
        /// Highest word of the unique number.
        uid2: u32,
        /// Board version, programmed at the factory; 255 if blank.
        version: u8,
        /// Minor board version; 255 if blank.
        version_minor: u8,
        /// Voltage variant of the board, which decides the divider; 255 if blank.
        version_volt: u8,
        /// Clock of the processor.
        clock_hz: u32,
    } + {
        /// Brown-out reset level, 0 (off) to 3.
        brown_out: u8,
    }
    /// End of the previous image. The drive stays refused until its fault is reset.
    Crash "crash n={=u32} cause={=str} pc={=u32:#x} lr={=u32:#x} status={=u32:#x} address={=u32:#x} line={=u32} file={=str} released={=u32} kept={=u32}" {
        /// Cause: `panic`, `hard_fault`, `stack_overflow`, `interrupt`, `clock`.
        cause: &'static str,
        /// Program counter; zero where the processor could not store it.
        pc: u32,
        /// Return address; for a stack overflow, a possible caller of the deepest function.
        lr: u32,
        /// Fault status register, or the number of an unhandled interrupt.
        status: u32,
        /// Address of a bus fault; all ones without one.
        address: u32,
        /// Line of a panic.
        line: u32,
        /// End of a panic's file name, or `-`.
        file: &'static str,
    } + {
        /// Clock (that of `loops`) when the bridges were off.
        released: u32,
        /// Clock when this record was complete, before the reset.
        kept: u32,
    }
    /// Reason why the drive cannot be enabled until a restart or until the cause is gone.
    Refused "refused n={=u32} why={=str} value={=u32:#x}" {
        /// Word for the reason.
        why: &'static str,
        /// Measured value.
        value: u32,
    }
    /// Status of a gate driver, once per driver when one of its faults inhibits enabling.
    GateDriver "gate_driver n={=u32} why={=str} joint={=u8} status={=u32:#x}" {
        /// Inhibit reason, `gate_fault` or `gate_configuration`.
        why: &'static str,
        /// Joint, from 1.
        joint: u8,
        /// Status registers of the DRV8301, the first in the upper half; all ones without an answer.
        status: u32,
    }
    /// Change of drive state or activity.
    State "state n={=u32} tick={=u32} drive={=str} activity={=str} phase={=str} motion={=u8}" {
        /// Servo tick.
        tick: u32,
        /// Drive state, see [`super::words::drive`].
        drive: &'static str,
        /// Activity, see [`super::words::activity`].
        activity: &'static str,
        /// Phase of the activity, see [`super::words::activity`].
        phase: &'static str,
        /// Held-out motion from 1, see [`super::words::activity`].
        motion: u8,
    }
    /// Request of the operator.
    Request "request n={=u32} tick={=u32} name={=str} accepted={=bool}" {
        /// Servo tick.
        tick: u32,
        /// Name of the request.
        name: &'static str,
        /// False if refused.
        accepted: bool,
    }
    /// A session of assistance was refused or is ending.
    Assist "assist n={=u32} tick={=u32} event={=str} why={=str}" {
        /// Servo tick.
        tick: u32,
        /// Event, see `words::assist`.
        event: &'static str,
        /// Reason, see `words::assist`.
        why: &'static str,
    }
    /// Refusal of a step towards an enabled drive.
    NotEnabled "not_enabled n={=u32} tick={=u32} joint={=u8} why={=str}" {
        /// Servo tick.
        tick: u32,
        /// Joint, from 1; 0 is the leg.
        joint: u8,
        /// Reason, see [`crate::leg::RefusalReason::name`].
        why: &'static str,
    }
    /// Fault of the leg.
    Fault "fault n={=u32} tick={=u32} code={=u16:#x} name={=str} joint={=u8}" {
        /// Servo tick of detection.
        tick: u32,
        /// CiA 402 error code.
        code: u16,
        /// Name, see [`crate::leg::FaultCode::name`].
        name: &'static str,
        /// Joint, from 1.
        joint: u8,
    }
    /// Fault that an axis or the board detected itself.
    AxisFault "axis_fault n={=u32} tick={=u32} joint={=u8} name={=str}" {
        /// Servo tick.
        tick: u32,
        /// Joint, from 1; 0 for the board.
        joint: u8,
        /// Word, see [`super::words::axis_fault`], or the board's word.
        name: &'static str,
    }
    /// Active torque limit of a joint: no fault; logged once a second at most.
    Limit "limit n={=u32} tick={=u32} code={=u8} name={=str} joint={=u8}" {
        /** Servo tick. */ tick: u32,
        /** Number of the [`crate::leg::LimitCode`]. */ code: u8,
        /** Word for the limit. */ name: &'static str,
        /** Joint, from 1. */ joint: u8,
    }
    /// An index pulse while an axis is off changed whether its index is certain.
    Index "index n={=u32} joint={=u8} certain={=bool}" {
        /// Joint, from 1.
        joint: u8,
        /// Two pulses came whole motor turns apart, so a stored calibration needs no motion.
        certain: bool,
    }
    /// Result of a calibration.
    Calibration "calibration n={=u32} joint={=u8} result={=str} number={=u32} resistance_ohm={=f32} direct_h={=f32} quadrature_h={=f32} offset_turns={=f32} zero_b={=f32} zero_c={=f32} stated={=f32} found={=f32}" {
        /// Joint, from 1.
        joint: u8,
        /// Result: `done`, or see [`super::words::calibration`].
        result: &'static str,
        /// Number that belongs to a refusal.
        number: u32,
        /// Resistance of one phase.
        resistance_ohm: f32,
        /// Inductance along the flux.
        direct_h: f32,
        /// Inductance across the flux.
        quadrature_h: f32,
        /// Electrical angle at encoder count zero.
        offset_turns: f32,
        /// Current-sensor offset of phase B, converter codes.
        zero_b: f32,
        /// Current-sensor offset of phase C, converter codes.
        zero_c: f32,
    } + {
        /// Value of the leg file or of the stored calibration that a refusal contradicts; NaN without one.
        stated: f32,
        /// Value found instead, in the same unit.
        found: f32,
    }
    /// Further results of a calibration in motion. A sigma is one standard deviation of a value here or in
    /// the record `calibration` before it.
    CalibrationFindings "calibration_findings n={=u32} joint={=u8} flux_wb={=f32} friction_a={=f32} load_a={=f32} resistance_sigma_ohm={=f32} direct_sigma_h={=f32} quadrature_sigma_h={=f32} offset_sigma_turns={=f32} flux_sigma_wb={=f32} friction_sigma_a={=f32}" {
        /// Joint, from 1.
        joint: u8,
        /// Flux linkage of the magnets; torque per ampere is 1.5 pole pairs times as much.
        flux_wb: f32,
        /// Quadrature current that friction takes at the calibration's speed.
        friction_a: f32,
        /// Quadrature current that the load takes on the path.
        load_a: f32,
        /// Uncertainty of the resistance.
        resistance_sigma_ohm: f32,
        /// Uncertainty of the inductance along the flux.
        direct_sigma_h: f32,
        /// Uncertainty of the inductance across the flux.
        quadrature_sigma_h: f32,
        /// Uncertainty of the offset.
        offset_sigma_turns: f32,
        /// Uncertainty of the flux linkage.
        flux_sigma_wb: f32,
        /// Uncertainty of the friction.
        friction_sigma_a: f32,
    }
    /// Progress of the search.
    Progress "progress n={=u32} tick={=u32} iterations={=u32} evaluations={=u32} excess_chi2={=f32}" {
        /// Servo tick.
        tick: u32,
        /// Iterations of the swarm.
        iterations: u32,
        /// Evaluations of the swarm.
        evaluations: u32,
        /// Best cost so far above least squares.
        excess_chi2: f32,
    }
    /// Solver of the identification.
    Solver "solver n={=u32} plan={=str} swarm_seed={=u64} state={=str} iterations={=u32} evaluations={=u32} steps={=u32} rank={=u8} base={=u8} dropped={=u8} condition={=f32} consistency_chi2={=f32}" {
        /// Plan: `one-time` or `sequential`.
        plan: &'static str,
        /// Seed of the swarm's random generator.
        swarm_seed: u64,
        /// State: `running`, `done` or `failed`.
        state: &'static str,
        /// Iterations of the swarm.
        iterations: u32,
        /// Evaluations of the swarm.
        evaluations: u32,
        /// Newton steps of the completion.
        steps: u32,
        /// Number of base parameters that the data determine.
        rank: u8,
        /// Number of base parameters.
        base: u8,
        /// Number of base parameters held at zero.
        dropped: u8,
        /// Condition number of the scaled problem.
        condition: f32,
        /// Cost of the physically consistent leg above least squares.
        consistency_chi2: f32,
    }
    /// One of a joint's fourteen parameters.
    Parameter "parameter n={=u32} joint={=u8} symbol={=str} value={=f32} unit={=str} sigma={=f32} status={=str}" {
        /// Joint, from 1.
        joint: u8,
        /// Symbol, such as `XX` or `FC`.
        symbol: &'static str,
        /// Value, SI; NaN where unknown.
        value: f32,
        /// Unit, see `words::unit`.
        unit: &'static str,
        /// Standard deviation; NaN unless measured alone.
        sigma: f32,
        /// Status: `identified`, `grouped`, `weak` or `prior`.
        status: &'static str,
    }
    /// One base parameter.
    Base "base n={=u32} index={=u8} joint={=u8} symbol={=str} grouped={=bool} dropped={=bool} value={=f32} unit={=str} sigma={=f32} least_squares={=f32}" {
        /// Index, from 0.
        index: u8,
        /// Joint of the parameter that stands for it, from 1.
        joint: u8,
        /// Symbol of that parameter.
        symbol: &'static str,
        /// True if other parameters are regrouped into it.
        grouped: bool,
        /// True if held at zero.
        dropped: bool,
        /// Value, SI; NaN where not determined.
        value: f32,
        /// Unit, see `words::unit`.
        unit: &'static str,
        /// Standard deviation; NaN where not determined.
        sigma: f32,
        /// Closed-form value.
        least_squares: f32,
    }
    /// One element of the base parameters' covariance, on or below its diagonal.
    Covariance "covariance n={=u32} row={=u8} column={=u8} value={=f32}" {
        /// Row, from 0.
        row: u8,
        /// Column, from 0, at most the row.
        column: u8,
        /// Element, SI.
        value: f32,
    }
    /// Stribeck friction of a joint that shows it.
    Stribeck "stribeck n={=u32} joint={=u8} surplus_nm={=f32} surplus_sigma_nm={=f32} speed_rad_s={=f32} speed_sigma_rad_s={=f32} gain_chi2={=f32}" {
        /// Joint, from 1.
        joint: u8,
        /// Static friction less Coulomb's.
        surplus_nm: f32,
        /// Standard deviation of the surplus.
        surplus_sigma_nm: f32,
        /// Speed at which the surplus has fallen to 1/e.
        speed_rad_s: f32,
        /// Standard deviation of the speed.
        speed_sigma_rad_s: f32,
        /// Chi-square that the surplus explains.
        gain_chi2: f32,
    }
    /// A recorded motion.
    Motion "motion n={=u32} motion={=u8} samples={=u32} rejected={=u32} longest_common_s={=f32} row_information={=f32}" {
        /// Motion; 0 is the one identified from.
        motion: u8,
        /// Number of 500 Hz samples.
        samples: u32,
        /// Number of samples and rows that were not finite.
        rejected: u32,
        /// Longest time with all joints' rows disturbed at once.
        longest_common_s: f32,
        /// Information of one row, in independent ones.
        row_information: f32,
    }
    /// Fit of one joint in one motion.
    Fit "fit n={=u32} motion={=u8} joint={=u8} rows={=u32} rms_nm={=f32} mean_abs_nm={=f32} torque_rms_nm={=f32} speed_rms_rad_s={=f32} disturbed_share={=f32} disturbed_longest_s={=f32} replaced={=u32}" {
        /// Motion; 0 is the one identified from.
        motion: u8,
        /// Joint, from 1.
        joint: u8,
        /// Rows in which the joint moved.
        rows: u32,
        /// Root mean square of measured minus predicted torque.
        rms_nm: f32,
        /// Mean absolute torque.
        mean_abs_nm: f32,
        /// Root mean square torque.
        torque_rms_nm: f32,
        /// Root mean square speed.
        speed_rms_rad_s: f32,
        /// Share of disturbed rows.
        disturbed_share: f32,
        /// Longest disturbed stretch.
        disturbed_longest_s: f32,
        /// Number of replaced outliers.
        replaced: u32,
    }
    /// One test of the verdict.
    Finding "finding n={=u32} reason={=str} test={=str} joint={=u8} motion={=u8} value={=f32} limit={=f32} passed={=bool}" {
        /// Reason of a refusal if the test failed.
        reason: &'static str,
        /// Word for the test.
        test: &'static str,
        /// Joint, from 1; 0 for a test of all joints.
        joint: u8,
        /// Held-out motion, from 1; 0 is the motion identified from, or all.
        motion: u8,
        /// Measured value.
        value: f32,
        /// Limit of the value.
        limit: f32,
        /// True if within the limit.
        passed: bool,
    }
    /// One reason against a result.
    Reason "reason n={=u32} reason={=str}" {
        /// Word from the closed list.
        reason: &'static str,
    }
    /// Verdict of an identification.
    Verdict "verdict n={=u32} verdict={=str} reasons={=u8}" {
        /// Verdict: `accepted` or `refused`.
        verdict: &'static str,
        /// Number of `reason` records before it.
        reasons: u8,
    }
    /// End of a result; a listener with another count of records has lost some.
    End "end n={=u32} records={=u32}" {
        /// Number of records of this result, without this one.
        records: u32,
    }
    /// Alarm: the accepted model no longer fits.
    Change "change n={=u32} since_s={=f32} joints={=?} statistic={=?} limit={=f32}" {
        /// Time since the change began.
        since_s: f32,
        /// Joints whose sum is above half of the limit.
        joints: [bool; N],
        /// Cumulative sum of each joint.
        statistic: [f32; N],
        /// Limit that a sum reached.
        limit: f32,
    }
    /// Explanation of a change.
    Update "update n={=u32} cause={=str} link={=u8} verdict={=str} offered={=bool}" {
        /// Cause, see `words::cause`.
        cause: &'static str,
        /// Link of a payload, from 1.
        link: u8,
        /// Verdict: `accepted` or `refused`.
        verdict: &'static str,
        /// True if the operator may take the update into use.
        offered: bool,
    }
    /// Timing, stack and losses of the loops since the previous record.
    Loops "loops n={=u32} tick={=u32} current_worst={=u32} servo_worst={=u32} current_missed={=u32} servo_missed={=u32} cycles_per_tick={=u32} stack_used={=u32} stack_bytes={=u32} samples_lost={=u32} records_lost={=u32}" {
        /// Servo tick.
        tick: u32,
        /// Longest current tick of either axis, processor cycles.
        current_worst: u32,
        /// Longest servo tick, processor cycles; includes interruptions by current ticks.
        servo_worst: u32,
        /// Current ticks that came late or not at all, since the start.
        current_missed: u32,
        /// Servo ticks that came late or not at all, since the start.
        servo_missed: u32,
        /// Processor cycles per servo tick.
        cycles_per_tick: u32,
        /// Deepest stack use so far, bytes.
        stack_used: u32,
        /// Size of the stack, bytes.
        stack_bytes: u32,
        /// Logged samples that identification did not take in time, since the start.
        samples_lost: u32,
        /// Records lost before the probe for lack of space, since the start. Gaps in the numbers show the
        /// probe's own losses.
        records_lost: u32,
    }
    /// Supply and temperatures.
    Supply "supply n={=u32} tick={=u32} bus_v={=f32} bus_low_v={=f32} bus_high_v={=f32} bridge_c={=?} chopper_c={=f32} chopper_duty={=f32} winding_c={=?}" {
        /// Servo tick.
        tick: u32,
        /// Present bus voltage.
        bus_v: f32,
        /// Lowest bus voltage since the previous record.
        bus_low_v: f32,
        /// Highest bus voltage since the previous record.
        bus_high_v: f32,
        /// Temperature of each axis' bridge, degrees Celsius.
        bridge_c: [f32; N],
        /// Temperature of the brake chopper, degrees Celsius.
        chopper_c: f32,
        /// Present duty of the brake chopper, 0..1.
        chopper_duty: f32,
    } + {
        /// Temperature of each motor's winding by its model, degrees Celsius.
        winding_c: [f32; N],
    }
    /// One sample of the 500 Hz log, on request.
    Log "log n={=u32} tick={=u32} segment={=str} motion={=u8} position_rad={=?} torque_nm={=?} counts={=?}" {
        /// Last of the sample's eight servo ticks.
        tick: u32,
        /// Use of the sample, see [`super::words::segment`].
        segment: &'static str,
        /// Held-out motion, from 1.
        motion: u8,
        /// Angles of the model.
        position_rad: [f32; N],
        /// Torques of the model.
        torque_nm: [f32; N],
        /// Sums of eight encoder counts, with the drive's sign: the exact angles.
        counts: [i32; N],
    }
    } };
}
trace_records!(records);

#[cfg(test)]
mod tests;

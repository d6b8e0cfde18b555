//! Everything that can be told.
//!
//! A format string is written once and serves twice: with `defmt` the device sends index and values, without [`Record::write`] fills it in; first comes its number.

use core::fmt::{self, Write};

use super::definition::records;
use super::fill::{Value, fill};

records! {
    /// The image has started.
    Boot "boot n={=u32} grammar={=u8} version={=str} leg={=str} joints={=u8} base={=u8} servo_hz={=u32} log_hz={=u32} reset={=str}" {
        /// [`super::GRAMMAR`].
        grammar: u8,
        /// Of the firmware.
        version: &'static str,
        /// Name of the leg it is built for.
        leg: &'static str,
        /// Of the leg.
        joints: u8,
        /// Base parameters.
        base: u8,
        /// Ticks per second.
        servo_hz: u32,
        /// Logged samples per second.
        log_hz: u32,
        /// Why the board started.
        reset: &'static str,
    }
    /// Which board, and what it found of itself; all zero in the emulator.
    Board "board n={=u32} uid0={=u32:#x} uid1={=u32:#x} uid2={=u32:#x} version={=u8} version_minor={=u8} version_volt={=u8} clock_hz={=u32}" {
        /// Lowest word of the unique number.
        uid0: u32,
        /// Middle word.
        uid1: u32,
        /// Highest word.
        uid2: u32,
        /// As burnt in at the factory; 255 where nothing is.
        version: u8,
        /// The same.
        version_minor: u8,
        /// The same: the voltage that decides the divider.
        version_volt: u8,
        /// Of the processor.
        clock_hz: u32,
    }
    /// How the image before this one ended. The drive stays refused until its fault is reset.
    Crash "crash n={=u32} cause={=str} pc={=u32:#x} lr={=u32:#x} status={=u32:#x} address={=u32:#x} line={=u32} file={=str} released={=u32} kept={=u32}" {
        /// `panic`, `hard_fault`, `stack_overflow`, `interrupt`, `clock`.
        cause: &'static str,
        /// Where; zero where the processor could not store it.
        pc: u32,
        /// Called from; of a stack overflow from where its deepest function may have been called.
        lr: u32,
        /// Fault status register, or the number of an interrupt nobody handles.
        status: u32,
        /// Address of a bus fault; all ones where there is none.
        address: u32,
        /// Of a panic.
        line: u32,
        /// End of a panic's file name, or `-`.
        file: &'static str,
        /// Clock (that of `loops`) when the bridges were off.
        released: u32,
        /// Clock when this record was complete, before the reset.
        kept: u32,
    }
    /// Why the drive may not be enabled at all until the board is started again or the cause is gone.
    Refused "refused n={=u32} why={=str} value={=u32:#x}" {
        /// A word.
        why: &'static str,
        /// What was found.
        value: u32,
    }
    /// Status of a gate driver, once per driver when a cause of theirs forbids to enable.
    GateDriver "gate_driver n={=u32} why={=str} joint={=u8} status={=u32:#x}" {
        /// `gate_fault` or `gate_configuration`.
        why: &'static str,
        /// From 1.
        joint: u8,
        /// Status registers of the DRV8301, the first in the upper half; all ones if it does not answer.
        status: u32,
    }
    /// Drive or activity changed.
    State "state n={=u32} tick={=u32} drive={=str} activity={=str} phase={=str} motion={=u8}" {
        /// Servo tick.
        tick: u32,
        /// [`super::words::drive`].
        drive: &'static str,
        /// [`super::words::activity`].
        activity: &'static str,
        /// The same.
        phase: &'static str,
        /// The same.
        motion: u8,
    }
    /// The operator asked.
    Request "request n={=u32} tick={=u32} name={=str} accepted={=bool}" {
        /// Servo tick.
        tick: u32,
        /// What for.
        name: &'static str,
        /// Or refused.
        accepted: bool,
    }
    /// A step towards an enabled drive was refused.
    NotEnabled "not_enabled n={=u32} tick={=u32} joint={=u8} why={=str}" {
        /// Servo tick.
        tick: u32,
        /// From 1; 0 is the leg.
        joint: u8,
        /// [`super::words::refusal`].
        why: &'static str,
    }
    /// A fault of the leg.
    Fault "fault n={=u32} tick={=u32} code={=u16:#x} name={=str} joint={=u8}" {
        /// Servo tick at which it was seen.
        tick: u32,
        /// CiA 402 error code.
        code: u16,
        /// [`super::words::fault`].
        name: &'static str,
        /// From 1.
        joint: u8,
    }
    /// A fault that an axis or the board found by itself.
    AxisFault "axis_fault n={=u32} tick={=u32} joint={=u8} name={=str}" {
        /// Servo tick.
        tick: u32,
        /// From 1; 0 is the board.
        joint: u8,
        /// [`super::words::axis_fault`], or the board's word.
        name: &'static str,
    }
    /// Something takes from the torque that is asked of a joint: no fault; told once a second at most.
    Limit "limit n={=u32} tick={=u32} code={=u8} name={=str} joint={=u8}" {
        /** Servo tick. */ tick: u32,
        /** [`crate::leg::LimitCode`]. */ code: u8,
        /** Its word. */ name: &'static str,
        /** From 1. */ joint: u8,
    }
    /// How a calibration ended.
    Calibration "calibration n={=u32} joint={=u8} result={=str} number={=u32} resistance_ohm={=f32} direct_h={=f32} quadrature_h={=f32} offset_turns={=f32} zero_b={=f32} zero_c={=f32}" {
        /// From 1.
        joint: u8,
        /// `done`, or [`super::words::calibration`].
        result: &'static str,
        /// Goes with a refusal.
        number: u32,
        /// Of one phase.
        resistance_ohm: f32,
        /// Inductance along the flux.
        direct_h: f32,
        /// Across it.
        quadrature_h: f32,
        /// Electrical angle where counts begin.
        offset_turns: f32,
        /// Shunt without current, converter codes.
        zero_b: f32,
        /// The same.
        zero_c: f32,
    }
    /// The search goes on.
    Progress "progress n={=u32} tick={=u32} iterations={=u32} evaluations={=u32} excess_chi2={=f32}" {
        /// Servo tick.
        tick: u32,
        /// Of the swarm.
        iterations: u32,
        /// Of the swarm.
        evaluations: u32,
        /// Best cost so far above least squares.
        excess_chi2: f32,
    }
    /// The solver of the identification.
    Solver "solver n={=u32} plan={=str} swarm_seed={=u64} state={=str} iterations={=u32} evaluations={=u32} steps={=u32} rank={=u8} base={=u8} dropped={=u8} condition={=f32} consistency_chi2={=f32}" {
        /// `one-time` or `sequential`.
        plan: &'static str,
        /// Of the swarm's random numbers.
        swarm_seed: u64,
        /// `running`, `done` or `failed`.
        state: &'static str,
        /// Of the swarm.
        iterations: u32,
        /// Of the swarm.
        evaluations: u32,
        /// Of the completion.
        steps: u32,
        /// Base parameters that the data determine.
        rank: u8,
        /// Base parameters there are.
        base: u8,
        /// Of them held at zero.
        dropped: u8,
        /// Of the scaled problem.
        condition: f32,
        /// What a leg that can exist costs above least squares.
        consistency_chi2: f32,
    }
    /// One of a joint's fourteen parameters.
    Parameter "parameter n={=u32} joint={=u8} symbol={=str} value={=f32} unit={=str} sigma={=f32} status={=str}" {
        /// From 1.
        joint: u8,
        /// `XX`, `FC`, ...
        symbol: &'static str,
        /// SI; NaN where nothing tells.
        value: f32,
        /// [`super::words::unit`].
        unit: &'static str,
        /// Standard deviation; NaN unless measured alone.
        sigma: f32,
        /// `identified`, `grouped`, `weak` or `prior`.
        status: &'static str,
    }
    /// One base parameter.
    Base "base n={=u32} index={=u8} joint={=u8} symbol={=str} grouped={=bool} dropped={=bool} value={=f32} unit={=str} sigma={=f32} least_squares={=f32}" {
        /// From 0.
        index: u8,
        /// Of the carrier, from 1.
        joint: u8,
        /// Of the carrier.
        symbol: &'static str,
        /// Others are regrouped into it.
        grouped: bool,
        /// Held at zero.
        dropped: bool,
        /// SI; NaN where not determined.
        value: f32,
        /// [`super::words::unit`].
        unit: &'static str,
        /// Standard deviation; NaN where not determined.
        sigma: f32,
        /// Of the closed form.
        least_squares: f32,
    }
    /// One element of the base parameters' covariance, on or below its diagonal.
    Covariance "covariance n={=u32} row={=u8} column={=u8} value={=f32}" {
        /// From 0.
        row: u8,
        /// From 0, at most the row.
        column: u8,
        /// SI.
        value: f32,
    }
    /// Stribeck friction of a joint that shows it.
    Stribeck "stribeck n={=u32} joint={=u8} surplus_nm={=f32} surplus_sigma_nm={=f32} speed_rad_s={=f32} speed_sigma_rad_s={=f32} gain_chi2={=f32}" {
        /// From 1.
        joint: u8,
        /// Static friction less Coulomb's.
        surplus_nm: f32,
        /// Standard deviation.
        surplus_sigma_nm: f32,
        /// Speed at which it has fallen to 1/e.
        speed_rad_s: f32,
        /// Standard deviation.
        speed_sigma_rad_s: f32,
        /// Chi-square that it explains.
        gain_chi2: f32,
    }
    /// A recorded motion.
    Motion "motion n={=u32} motion={=u8} samples={=u32} rejected={=u32} longest_common_s={=f32} row_information={=f32}" {
        /// 0 is the one identified from.
        motion: u8,
        /// 500 Hz samples.
        samples: u32,
        /// Samples and rows that were not finite.
        rejected: u32,
        /// Longest time for which all joints' rows were disturbed at once.
        longest_common_s: f32,
        /// Of one row, in independent ones.
        row_information: f32,
    }
    /// One joint on one motion.
    Fit "fit n={=u32} motion={=u8} joint={=u8} rows={=u32} rms_nm={=f32} mean_abs_nm={=f32} torque_rms_nm={=f32} speed_rms_rad_s={=f32} disturbed_share={=f32} disturbed_longest_s={=f32} replaced={=u32}" {
        /// 0 is the one identified from.
        motion: u8,
        /// From 1.
        joint: u8,
        /// In which the joint moved.
        rows: u32,
        /// Measured minus predicted torque.
        rms_nm: f32,
        /// Of the torque.
        mean_abs_nm: f32,
        /// Of the torque.
        torque_rms_nm: f32,
        /// Of the speed.
        speed_rms_rad_s: f32,
        /// Of the rows.
        disturbed_share: f32,
        /// At a stretch.
        disturbed_longest_s: f32,
        /// Wild samples.
        replaced: u32,
    }
    /// One test of the verdict.
    Finding "finding n={=u32} reason={=str} test={=str} joint={=u8} motion={=u8} value={=f32} limit={=f32} passed={=bool}" {
        /// Why the result is refused if it failed.
        reason: &'static str,
        /// Which.
        test: &'static str,
        /// From 1; 0 where it is not about one joint.
        joint: u8,
        /// Of the validation, from 1; 0 is the motion identified from, or all.
        motion: u8,
        /// What was seen.
        value: f32,
        /// What is allowed.
        limit: f32,
        /// Within it.
        passed: bool,
    }
    /// One reason against a result.
    Reason "reason n={=u32} reason={=str}" {
        /// Of the closed list.
        reason: &'static str,
    }
    /// The last word on an identification.
    Verdict "verdict n={=u32} verdict={=str} reasons={=u8}" {
        /// `accepted` or `refused`.
        verdict: &'static str,
        /// How many `reason` records stand before it.
        reasons: u8,
    }
    /// The result has been told; a listener who counts another number of records has lost some.
    End "end n={=u32} records={=u32}" {
        /// Of this result, this one not included.
        records: u32,
    }
    /// The accepted model no longer fits.
    Change "change n={=u32} since_s={=f32} joints={=?} statistic={=?} limit={=f32}" {
        /// How long ago it began.
        since_s: f32,
        /// Whose sum stands above half of the limit.
        joints: [bool; N],
        /// Sums.
        statistic: [f32; N],
        /// What one of them reached.
        limit: f32,
    }
    /// What the change was taken for.
    Update "update n={=u32} cause={=str} link={=u8} verdict={=str} offered={=bool}" {
        /// [`super::words::cause`].
        cause: &'static str,
        /// From 1.
        link: u8,
        /// `accepted` or `refused`.
        verdict: &'static str,
        /// The operator may take it into use.
        offered: bool,
    }
    /// How the loops do, since the record before.
    Loops "loops n={=u32} tick={=u32} current_worst={=u32} servo_worst={=u32} current_missed={=u32} servo_missed={=u32} cycles_per_tick={=u32} stack_used={=u32} stack_bytes={=u32} samples_lost={=u32} records_lost={=u32}" {
        /// Servo tick.
        tick: u32,
        /// Longest current tick of either axis, processor cycles (instructions in the emulator).
        current_worst: u32,
        /// Longest servo tick, the same; interrupted by current ticks.
        servo_worst: u32,
        /// Current ticks that came late or not at all, since the start.
        current_missed: u32,
        /// Servo ticks, the same.
        servo_missed: u32,
        /// Of the servo.
        cycles_per_tick: u32,
        /// Deepest so far.
        stack_used: u32,
        /// There are.
        stack_bytes: u32,
        /// Logged samples that identification did not take in time, since the start.
        samples_lost: u32,
        /// Records that found no room on their way to the probe, since the start; what the probe itself lost, the gaps tell.
        records_lost: u32,
    }
    /// Supply and temperatures.
    Supply "supply n={=u32} tick={=u32} bus_v={=f32} bus_low_v={=f32} bus_high_v={=f32} bridge_c={=?} chopper_c={=f32} chopper_duty={=f32}" {
        /// Servo tick.
        tick: u32,
        /// Now.
        bus_v: f32,
        /// Lowest since the record before.
        bus_low_v: f32,
        /// Highest, the same.
        bus_high_v: f32,
        /// Of each axis' bridge, degrees Celsius.
        bridge_c: [f32; N],
        /// Of the brake chopper, degrees Celsius.
        chopper_c: f32,
        /// Now, 0..1.
        chopper_duty: f32,
    }
    /// One sample of the 500 Hz log, on request.
    Log "log n={=u32} tick={=u32} segment={=str} motion={=u8} position_rad={=?} torque_nm={=?} counts={=?}" {
        /// The last of its eight servo ticks.
        tick: u32,
        /// [`super::words::segment`].
        segment: &'static str,
        /// Of the validation, from 1.
        motion: u8,
        /// The model's angles.
        position_rad: [f32; N],
        /// The model's torques.
        torque_nm: [f32; N],
        /// Sums of eight encoder counts, the drive's sign: the same angles, exact.
        counts: [i32; N],
    }
}

#[cfg(test)]
mod tests;

//! Object dictionary: all objects of a node, each listed once.
//!
//! The firmware reads the rows. The writer of the electronic data sheet (EDS) reads rows and names.
//!
//! ```text
//! index [x indices], subindex [xN subindices], type, access, PDO, default [+ node], name
//! ```
//!
//! PDO subindices follow CiA 301, drive objects CiA 402. Two objects exist for other makers' host software:
//! 219A is mapped by recorded software, 2194 by published software (docs/bus.md).

use super::dictionary::{Access, Mapping, Row, Type};

/// Indices with several subindices: first index, number of indices, name, and whether all parts have one
/// type.
pub static GROUPS: &[(u16, u16, &str, bool)] = &[
    (0x1003, 1, "Pre-defined error field", true),
    (0x1010, 1, "Store parameters", true),
    (0x1011, 1, "Restore default parameters", true),
    (0x1016, 1, "Consumer heartbeat time", true),
    (0x1018, 1, "Identity object", false),
    (0x1029, 1, "Error behaviour", true),
    (0x1200, 1, "SDO server parameter", false),
    (0x1400, 4, "RPDO communication parameter", false),
    (0x1600, 4, "RPDO mapping parameter", false),
    (0x1800, 4, "TPDO communication parameter", false),
    (0x1A00, 4, "TPDO mapping parameter", false),
    (0x1F50, 1, "Program data", true),
    (0x1F51, 1, "Program control", true),
    (0x1F56, 1, "Program software identification", true),
    (0x1F57, 1, "Flash status identification", true),
    (0x2020, 1, "Impedance", true),
    (0x2021, 1, "Bandwidths", true),
    (0x2100, 1, "Identification", false),
    (0x2110, 1, "Parameter", true),
    (0x2111, 1, "Parameter standard deviation", true),
    (0x2112, 1, "Parameter status", true),
    (0x2120, 1, "Base parameter", true),
    (0x2121, 1, "Base parameter standard deviation", true),
    (0x2122, 1, "Base parameter carrier", true),
    (0x2123, 1, "Base parameter flags", true),
    (0x2124, 1, "Base parameter by least squares", true),
    (0x2130, 1, "Fit: root mean square error", true),
    (0x2131, 1, "Fit: mean absolute torque", true),
    (0x2132, 1, "Fit: root mean square torque", true),
    (0x2133, 1, "Fit: rows", true),
    (0x2140, 1, "Log", false),
    (0x2150, 1, "Assistance", false),
    (0x2160, 1, "Commissioning", false),
    (0x2170, 1, "Telemetry", false),
    (0x607D, 1, "Software position limit", true),
    (0x608F, 1, "Position encoder resolution", false),
    (0x6091, 1, "Gear ratio", false),
    (0x60C1, 1, "Interpolation data record", false),
    (0x60C2, 1, "Interpolation time period", false),
    (0x60FE, 1, "Digital outputs", false),
];

/// Whether an object belongs to the leg: identification, assistance, commissioning or telemetry. A joint
/// alone does not have it.
pub(super) const fn is_of_leg(index: u16) -> bool {
    matches!(index, 0x2100..=0x2193)
}

macro_rules! rows {
    (@count) => { 1 };
    (@count $count:literal) => { $count };
    (@node) => { false };
    (@node node) => { true };
    ($( $index:literal $(x $indices:literal)?, $sub:literal $(x $subs:literal)?, $kind:ident, $access:ident, $mapping:ident,
        $default:literal $(+ $node:ident)?, $name:literal; )*) => {
        /// All objects, one row per range.
        pub static ROWS: &[Row] = &[$( Row {
            index: $index,
            indices: rows!(@count $($indices)?),
            sub: $sub,
            subs: rows!(@count $($subs)?),
            kind: Type::$kind,
            access: Access::$access,
            mapping: Mapping::$mapping,
            plus_node: rows!(@node $($node)?),
            default: $default,
        }, )*];

        /// Name of each row, in the order of [`ROWS`].
        pub static NAMES: &[&str] = &[$($name),*];
    };
}

rows! {
    0x1000, 0, U32, Const, No, 0x0002_0192, "Device type";
    0x1001, 0, U8, Read, Transmit, 0, "Error register";
    0x1003, 0, U8, Both, No, 0, "Number of errors";
    0x1003, 1 x 8, U32, Read, No, 0, "Standard error field";
    0x1005, 0, U32, Both, No, 0x80, "COB-ID SYNC message";
    0x1008, 0, Text, Read, No, 0, "Manufacturer device name";
    0x1009, 0, Text, Read, No, 0, "Manufacturer hardware version";
    0x100A, 0, Text, Read, No, 0, "Manufacturer software version";
    0x1010, 0, U8, Const, No, 1, "Number of entries";
    0x1010, 1, U32, Both, No, 1, "Store all parameters";
    0x1011, 0, U8, Const, No, 1, "Number of entries";
    0x1011, 1, U32, Both, No, 1, "Restore all default parameters";
    0x1014, 0, U32, Both, No, 0x80 + node, "COB-ID emergency message";
    0x1015, 0, U16, Both, No, 100, "Inhibit time emergency message";
    0x1016, 0, U8, Const, No, 2, "Number of entries";
    0x1016, 1 x 2, U32, Both, No, 0, "Consumer heartbeat time";
    0x1017, 0, U16, Both, No, 0, "Producer heartbeat time";
    0x1018, 0, U8, Const, No, 4, "Number of entries";
    0x1018, 1, U32, Read, No, 0, "Vendor-ID";
    0x1018, 2, U32, Read, No, 0, "Product code";
    0x1018, 3, U32, Read, No, 0, "Revision number";
    0x1018, 4, U32, Read, No, 0, "Serial number";
    0x1019, 0, U8, Both, No, 0, "Synchronous counter overflow value";
    0x1029, 0, U8, Const, No, 1, "Number of entries";
    0x1029, 1, U8, Both, No, 0, "Communication error";
    0x1200, 0, U8, Const, No, 2, "Number of entries";
    0x1200, 1, U32, Read, No, 0x600 + node, "COB-ID client to server";
    0x1200, 2, U32, Read, No, 0x580 + node, "COB-ID server to client";
    0x1400 x 4, 0, U8, Const, No, 5, "Number of entries";
    0x1400, 1, U32, Both, No, 0x200 + node, "COB-ID used by RPDO 1";
    0x1401, 1, U32, Both, No, 0x300 + node, "COB-ID used by RPDO 2";
    0x1402, 1, U32, Both, No, 0x400 + node, "COB-ID used by RPDO 3";
    0x1403, 1, U32, Both, No, 0x500 + node, "COB-ID used by RPDO 4";
    0x1400 x 4, 2, U8, Both, No, 255, "Transmission type";
    0x1400 x 4, 3, U16, Both, No, 0, "Inhibit time";
    0x1400 x 4, 4, U8, Both, No, 0, "Reserved";
    0x1400 x 4, 5, U16, Both, No, 0, "Event timer";
    0x1600 x 4, 0, U8, Both, No, 1, "Number of mapped objects";
    0x1600, 1, U32, Both, No, 0x6040_0010, "Mapped object";
    0x1601, 1, U32, Both, No, 0x607A_0020, "Mapped object";
    0x1602, 1, U32, Both, No, 0x60FF_0020, "Mapped object";
    0x1603, 1, U32, Both, No, 0x6071_0010, "Mapped object";
    0x1600 x 4, 2 x 7, U32, Both, No, 0, "Mapped object";
    0x1800 x 4, 0, U8, Const, No, 6, "Number of entries";
    0x1800, 1, U32, Both, No, 0x4000_0180 + node, "COB-ID used by TPDO 1";
    0x1801, 1, U32, Both, No, 0x4000_0280 + node, "COB-ID used by TPDO 2";
    0x1802, 1, U32, Both, No, 0x4000_0380 + node, "COB-ID used by TPDO 3";
    0x1803, 1, U32, Both, No, 0x4000_0480 + node, "COB-ID used by TPDO 4";
    0x1800, 2, U8, Both, No, 255, "Transmission type";
    0x1801 x 3, 2, U8, Both, No, 1, "Transmission type";
    0x1800 x 4, 3, U16, Both, No, 10, "Inhibit time";
    0x1800 x 4, 4, U8, Both, No, 0, "Reserved";
    0x1800 x 4, 5, U16, Both, No, 0, "Event timer";
    0x1800 x 4, 6, U8, Both, No, 0, "SYNC start value";
    0x1A00, 0, U8, Both, No, 1, "Number of mapped objects";
    0x1A01, 0, U8, Both, No, 2, "Number of mapped objects";
    0x1A02 x 2, 0, U8, Both, No, 1, "Number of mapped objects";
    0x1A00, 1, U32, Both, No, 0x6041_0010, "Mapped object";
    0x1A01, 1, U32, Both, No, 0x6064_0020, "Mapped object";
    0x1A02, 1, U32, Both, No, 0x6077_0010, "Mapped object";
    0x1A03, 1, U32, Both, No, 0x60FD_0020, "Mapped object";
    0x1A00, 2, U32, Both, No, 0, "Mapped object";
    0x1A01, 2, U32, Both, No, 0x606C_0020, "Mapped object";
    0x1A02 x 2, 2, U32, Both, No, 0, "Mapped object";
    0x1A00 x 4, 3 x 6, U32, Both, No, 0, "Mapped object";

    0x1F50, 0, U8, Const, No, 1, "Number of entries";
    0x1F50, 1, Domain, Write, No, 0, "Program 1";
    0x1F51, 0, U8, Const, No, 1, "Number of entries";
    0x1F51, 1, U8, Both, No, 1, "Program 1";
    0x1F56, 0, U8, Const, No, 1, "Number of entries";
    0x1F56, 1, U32, Read, No, 0, "Program 1";
    0x1F57, 0, U8, Const, No, 1, "Number of entries";
    0x1F57, 1, U32, Read, No, 0, "Program 1";

    0x2001, 0, U8, Both, No, 0, "Node-ID after the next start";
    0x2002, 0, U16, Both, No, 1000, "Bit rate after the next start";
    0x2010, 0, I16, Read, Transmit, 0, "Velocity actual value, short";
    0x2011, 0, U8, Both, No, 0, "Model in the feedforward";
    0x2012, 0, U8, Both, No, 1, "Return into the range";
    0x2013, 0, U8, Both, No, 1, "Silent host is missed";
    0x2020, 0, U8, Const, No, 4, "Number of entries";
    0x2020, 1, U16, Both, Receive, 0, "Stiffness";
    0x2020, 2, U16, Both, Receive, 0, "Damping";
    0x2020, 3, U16, Read, No, 0, "Largest stiffness";
    0x2020, 4, U16, Read, No, 0, "Largest damping";
    0x2021, 0, U8, Const, No, 6, "Number of entries";
    0x2021, 1, U16, Both, No, 0, "Bandwidth of the position loop";
    0x2021, 2, U16, Read, No, 0, "Least bandwidth of the position loop";
    0x2021, 3, U16, Read, No, 0, "Largest bandwidth of the position loop";
    0x2021, 4, U16, Both, No, 0, "Bandwidth of the current loop";
    0x2021, 5, U16, Read, No, 0, "Least bandwidth of the current loop";
    0x2021, 6, U16, Read, No, 0, "Largest bandwidth of the current loop";
    0x2100, 0, U8, Const, No, 13, "Number of entries";
    0x2100, 1, U8, Both, No, 0, "Command";
    0x2100, 2, U8, Read, Transmit, 0, "State";
    0x2100, 3, U8, Read, Transmit, 0, "Motion of the validation";
    0x2100, 4, U8, Both, No, 0, "Plan";
    0x2100, 5, U32, Both, No, 1, "Seed, lower half";
    0x2100, 6, U32, Both, No, 0, "Seed, upper half";
    0x2100, 7, U32, Read, No, 0, "Generation";
    0x2100, 8, U8, Read, No, 0, "Verdict";
    0x2100, 9, U8, Read, No, 0, "Reasons";
    0x2100, 10, U32, Read, No, 0, "Iterations";
    0x2100, 11, U32, Read, No, 0, "Evaluations";
    0x2100, 12, U8, Read, Transmit, 0, "Change";
    0x2100, 13, U8, Both, No, 0, "Leg: empty or worn";
    0x2110 x 3, 0, U8, Const, No, 14, "Number of entries";
    0x2110 x 2, 1 x 14, F32, Read, No, 0, "Parameter";
    0x2112, 1 x 14, U8, Read, No, 0, "Parameter";
    0x2120, 0, U8, Both, No, 13, "Number of entries";
    0x2121 x 4, 0, U8, Const, No, 13, "Number of entries";
    0x2120 x 2, 1 x 13, F32, Read, No, 0, "Base parameter";
    0x2122, 1 x 13, U16, Read, No, 0, "Base parameter";
    0x2123, 1 x 13, U8, Read, No, 0, "Base parameter";
    0x2124, 1 x 13, F32, Read, No, 0, "Base parameter";
    0x2130 x 4, 0, U8, Const, No, 4, "Number of entries";
    0x2130 x 3, 1 x 4, F32, Read, No, 0, "Motion";
    0x2133, 1 x 4, U32, Read, No, 0, "Motion";
    0x2140, 0, U8, Const, No, 4, "Number of entries";
    0x2140, 1, U32, Both, No, 0, "Samples held";
    0x2140, 2, Domain, Read, No, 0, "Samples";
    0x2140, 3, U32, Read, No, 0, "Samples waiting";
    0x2140, 4, U32, Read, No, 0, "Samples lost";
    0x2150, 0, U8, Const, No, 4, "Number of entries";
    0x2150, 1, U16, Both, No, 0, "Share of friction";
    0x2150, 2, U16, Both, No, 0, "Share of inertia";
    0x2150, 3, U16, Both, No, 0, "Share of the wearer's weight";
    0x2150, 4, I16, Both, No, 0, "Share of the periodic torque";
    0x2160, 0, U8, Const, No, 6, "Number of entries";
    0x2160, 1, U8, Both, No, 0, "Command: 1 calibrate, 2 take the reference, 3 reset";
    0x2160, 2, U8, Read, Transmit, 0, "State";
    0x2160, 3, U8, Read, Transmit, 0, "Result";
    0x2160, 4, U8, Read, No, 0, "Refused axis";
    0x2160, 5, U8, Read, No, 0, "Reason of the refusal";
    0x2160, 6, U8, Read, No, 0, "Detail of the reason";
    0x2170, 0, U8, Const, No, 8, "Number of entries";
    0x2170, 1, U32, Read, Transmit, 0, "Inhibit reasons";
    0x2170, 2, I16, Read, Transmit, 0, "Bridge temperature";
    0x2170, 3, I16, Read, Transmit, 0, "Winding temperature";
    0x2170, 4, I16, Read, Transmit, 0, "Phase current A";
    0x2170, 5, I16, Read, Transmit, 0, "Phase current B";
    0x2170, 6, I16, Read, Transmit, 0, "Phase current C";
    0x2170, 7, U32, Read, Transmit, 0, "Longest current interrupt";
    0x2170, 8, U32, Read, Transmit, 0, "Longest servo tick";
    0x2194, 0, U32, Both, Any, 0, "Digital outputs, raw";
    0x219A, 0, U32, Read, Transmit, 0, "Digital inputs, raw";
    0x6007, 0, I16, Both, No, 3, "Abort connection option code";
    0x603F, 0, U16, Read, Transmit, 0, "Error code";
    0x6040, 0, U16, Both, Any, 0, "Controlword";
    0x6041, 0, U16, Read, Transmit, 0, "Statusword";
    0x605A, 0, I16, Both, No, 2, "Quick stop option code";
    0x605B, 0, I16, Both, No, 0, "Shutdown option code";
    0x605C, 0, I16, Both, No, 0, "Disable operation option code";
    0x605D, 0, I16, Both, No, 1, "Halt option code";
    0x605E, 0, I16, Both, No, 2, "Fault reaction option code";
    0x6060, 0, I8, Both, Any, 0, "Modes of operation";
    0x6061, 0, I8, Read, Transmit, 0, "Modes of operation display";
    0x6062, 0, I32, Read, Transmit, 0, "Position demand value";
    0x6064, 0, I32, Read, Transmit, 0, "Position actual value";
    0x6065, 0, U32, Both, No, 87266, "Following error window";
    0x6066, 0, U16, Both, No, 10, "Following error time out";
    0x6067, 0, U32, Both, No, 17453, "Position window";
    0x6068, 0, U16, Both, No, 10, "Position window time";
    0x606B, 0, I32, Read, Transmit, 0, "Velocity demand value";
    0x606C, 0, I32, Read, Transmit, 0, "Velocity actual value";
    0x606D, 0, U16, Both, No, 50_000, "Velocity window";
    0x606E, 0, U16, Both, No, 10, "Velocity window time";
    0x606F, 0, U16, Both, No, 10_000, "Velocity threshold";
    0x6070, 0, U16, Both, No, 10, "Velocity threshold time";
    0x6071, 0, I16, Both, Any, 0, "Target torque";
    0x6072, 0, U16, Both, Any, 1000, "Max torque";
    0x6074, 0, I16, Read, Transmit, 0, "Torque demand";
    0x6075, 0, U32, Read, No, 0, "Motor rated current";
    0x6076, 0, U32, Read, No, 0, "Motor rated torque";
    0x6077, 0, I16, Read, Transmit, 0, "Torque actual value";
    0x607A, 0, I32, Both, Any, 0, "Target position";
    0x6078, 0, I16, Read, Transmit, 0, "Current actual value";
    0x6079, 0, U32, Read, Transmit, 0, "DC link circuit voltage";
    0x607C, 0, I32, Both, No, 0, "Home offset";
    0x607D, 0, U8, Const, No, 2, "Number of entries";
    0x607D, 1, I32, Both, No, 0x8000_0000, "Min position limit";
    0x607D, 2, I32, Both, No, 0x7FFF_FFFF, "Max position limit";
    0x607E, 0, U8, Both, No, 0, "Polarity";
    0x607F, 0, U32, Read, No, 0, "Max profile velocity";
    0x6080, 0, U32, Read, No, 0, "Max motor speed";
    0x6081, 0, U32, Both, Any, 500_000, "Profile velocity";
    0x6083, 0, U32, Both, Any, 2_000_000, "Profile acceleration";
    0x6084, 0, U32, Both, Any, 2_000_000, "Profile deceleration";
    0x6086, 0, I16, Both, No, 0, "Motion profile type";
    0x6087, 0, U32, Both, Any, 1000, "Torque slope";
    0x608F, 0, U8, Const, No, 2, "Number of entries";
    0x608F, 1, U32, Read, No, 0, "Encoder increments";
    0x608F, 2, U32, Const, No, 1, "Motor revolutions";
    0x6091, 0, U8, Const, No, 2, "Number of entries";
    0x6091, 1, U32, Read, No, 0, "Motor revolutions";
    0x6091, 2, U32, Const, No, 1000, "Shaft revolutions";
    0x6098, 0, I8, Both, No, 0, "Homing method";
    0x60A8, 0, U32, Const, No, 0xFA10_0000, "SI unit position";
    0x60A9, 0, U32, Const, No, 0xFA10_0300, "SI unit velocity";
    0x60AA, 0, U32, Const, No, 0xFA10_5700, "SI unit acceleration";
    0x60B1, 0, I32, Both, Any, 0, "Velocity offset";
    0x60B2, 0, I16, Both, Any, 0, "Torque offset";
    0x60C1, 0, U8, Const, No, 1, "Number of entries";
    0x60C1, 1, I32, Both, Any, 0, "Interpolation data record, first parameter";
    0x60C2, 0, U8, Const, No, 2, "Number of entries";
    0x60C2, 1, U8, Both, No, 2, "Interpolation time period";
    0x60C2, 2, I8, Both, No, 0xFD, "Interpolation time index";
    0x60F2, 0, U16, Both, No, 0, "Positioning option code";
    0x60F4, 0, I32, Read, Transmit, 0, "Following error actual value";
    0x60FD, 0, U32, Read, Transmit, 0, "Digital inputs";
    0x60FE, 0, U8, Const, No, 1, "Number of entries";
    0x60FE, 1, U32, Both, Any, 0, "Physical outputs";
    0x60FF, 0, I32, Both, Any, 0, "Target velocity";
    0x6502, 0, U32, Read, No, 0, "Supported drive modes";
}

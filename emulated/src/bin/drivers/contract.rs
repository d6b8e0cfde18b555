//! Agreement between the program and its check (`cargo chip drivers`): steps and results.
//!
//! The program writes the number of each step that it reaches to `DRIVERS_STEP`, and waits until `DRIVERS_GO`
//! holds that number. Results are in `DRIVERS_RESULTS`. Only the processor's step runs in the emulator too.

/// Results of the processor's step.
pub const PROCESSOR_WORDS: usize = 128;

/// Steps in their order. The program has just done what the name says, unless a comment says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Step {
    /// Computations and exceptions.
    Processor = 1,
    /// Clocks are set and measured.
    Clocks,
    /// Pins are set; the check reads them and drives some.
    Pins,
    /// Inputs are read; next the program waits for a rising edge of PC4.
    Edge,
    /// The edge came.
    Seen,
    /// Complementary outputs of TIM1, edge-aligned.
    Edges,
    /// Complementary outputs of TIM1, centre-aligned.
    Centred,
    /// Output 4 of TIM2.
    Chopper,
    /// Conversions.
    Analog,
    /// Gate driver written and read.
    Gates,
    /// CAN initialised and a frame sent; the check sends one next.
    Sent,
    /// Frame received; the check disconnects the partner next.
    Received,
    /// Frames without a partner.
    Alone,
    /// Next a sector is erased.
    Erase,
    /// Sector erased.
    Erased,
    /// Words written.
    Written,
    /// Next the watchdog starts; fed once if the check releases it with [`FED`] added.
    Watchdog,
    /// Watchdog runs.
    Bites,
}

/// Added to the release of [`Step::Watchdog`]: feed it once.
pub const FED: u32 = 0x100;

/// Places of the results after those of the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Place {
    /// Clocks as the driver states them, Hz: processor, buses 1 and 2, timers on them.
    Clock0 = PROCESSOR_WORDS,
    Clock1,
    Clock2,
    Clock3,
    Clock4,
    /// Processor cycles of `block_for` over 10 ms and of `Timer::after` over 5 ms.
    Blocked,
    Awaited,
    /// Levels read from inputs, as bits.
    Levels,
    /// Greatest duty of TIM1, edge-aligned and centre-aligned.
    Top,
    CentredTop,
    /// Codes: bus voltage (sum of 16), thermistor with 12 and with 8 bits.
    Bus,
    Warm,
    WarmShort,
    /// Answer of the gate driver, and processor cycles of the frame.
    Answer,
    FrameCycles,
    /// Received frame: identifier, length, data.
    Identifier,
    Length,
    Low,
    High,
    /// Error without a partner, and identifier of the frame that a more urgent one replaced.
    Error,
    Replaced,
    /// Whether a frame was accepted while a completed one with its identifier stays in a mailbox.
    Repeated,
    /// Outcomes of the flash driver as bits, and all bytes read after erasing, combined.
    Flash,
    Blank,
    /// Processor cycles of erasing a sector, and of writing four words.
    EraseCycles,
    WriteCycles,
}

/// Words that are written to flash.
pub const STORED: [u32; 4] = [0x0123_4567, 0x89AB_CDEF, 0xFFFF_0000, 0x5555_AAAA];

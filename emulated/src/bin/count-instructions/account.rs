//! The design's table: cost, bound and share of the processor of each periodic task.

use cortex_m_semihosting::hprintln;

use crate::counter::Tally;

/// Clock of the board's processor.
pub const PROCESSOR_HZ: f32 = 168e6;
/// Assumed cycles per instruction with the flash accelerator; to be confirmed on the board.
pub const CYCLES_PER_INSTRUCTION: f32 = 1.34;
const MOST_LINES: usize = 8;

#[derive(Clone, Copy)]
struct Line {
    name: &'static str,
    tally: Tally,
    goal: u32,
    per_second: u32,
}

/// Lines of the table.
#[derive(Default)]
pub struct Account([Option<Line>; MOST_LINES]);

impl Account {
    /// Adds a task that runs so often per second.
    pub fn add(&mut self, name: &'static str, tally: Tally, goal: u32, per_second: u32) {
        if let Some(free) = self.0.iter_mut().find(|line| line.is_none()) {
            *free = Some(Line { name, tally, goal, per_second });
        }
    }

    /// Prints the table; returns whether all bounds are met.
    pub fn report(&self) -> bool {
        hprintln!("\nAgainst the design, shares of {:.0} MHz", PROCESSOR_HZ / 1e6);
        hprintln!(
            "at {} cycles each {:>30} {:>7} {:>7} {:>9} {:>6}",
            CYCLES_PER_INSTRUCTION,
            "mean",
            "worst",
            "goal",
            "a second",
            "%"
        );
        let (mut is_within, mut sum) = (true, 0.0);
        for line in self.0.iter().flatten() {
            let share = percent(line.tally.mean(), line.per_second);
            sum += share;
            is_within &= line.tally.most() <= line.goal;
            let (mean, most) = (line.tally.mean(), line.tally.most());
            hprintln!(
                "{:<40} {:>7} {:>7} {:>7} {:>9} {:>6.1}",
                line.name,
                mean,
                most,
                line.goal,
                line.per_second,
                share
            );
        }
        hprintln!("{:<40} {:>40.1}", "in all; the search has the rest", sum);
        is_within
    }
}

/// Share of the processor, per cent.
pub fn percent(instructions: u32, per_second: u32) -> f32 {
    100.0 * instructions as f32 * per_second as f32 * CYCLES_PER_INSTRUCTION / PROCESSOR_HZ
}

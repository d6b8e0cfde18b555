//! A motion as a window of blocks: input of the reweighting, in memory independent of the duration.
//!
//! One factor for a whole motion cannot be reweighted: a push inside it cannot be removed. The motion is
//! therefore cut into blocks of `BLOCK_ROWS` filtered rows. Each block stores for each joint a small factor
//! over the columns that act on this joint's torque. When the memory is full two neighbours become one block:
//! among the adjacent pairs of equal level (doublings) the lowest and oldest. Blocks then have two
//! neighbouring levels, the youngest ones finer, whatever the duration. Only factors of similar size ever
//! meet, as single precision needs.
//!
//! ```text
//! joint i depends on   link columns of joints >= i, drive columns of joint i, its Stribeck columns
//! numbers of a block   sum over joints of  n_i (n_i + 3) / 2 + 1  and two more: sum of |torque|, rows
//! ```
//!
//! Memory: `NUMBERS` numbers and about 1 kB. For the default leg (9 + 3 and 7 + 3 columns) a block takes 161
//! numbers, so 8192 numbers hold 50 blocks: 22 s of motion in pieces of 0.32 and 0.64 s.
//! Cost: a row is rotated into a factor of its joint's columns. Every eighth output two blocks are merged,
//! one joint per call of `Window::tidy`, so that no sample bears the whole cost. The sums over blocks stay
//! the same meanwhile.
//! Limits: with three joints and 28 columns only 10 blocks fit. A chain with a joint that depends on more
//! than 32 columns is rejected.

use super::packed::{self, LARGEST_COLUMNS, Row};
use super::row_model::RowModel;
use super::rows::FilteredRows;
use super::stribeck::BANK;
use crate::model::Parameter;
use crate::real::{self, Real};

/// Outputs of the row filter, 50 a second, in a block.
pub(crate) const BLOCK_ROWS: u32 = 8;
/// Length of the device's window in numbers: 32 KB in single precision.
pub const NUMBERS: usize = 8192;
/// Most blocks of a window.
pub(crate) const LARGEST_BLOCKS: usize = 64;
/// Numbers of a joint in a block besides its factor: sum of the absolute torque, and rows.
const BESIDE: usize = 2;

/// Columns that act on one joint's torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Columns<const B: usize> {
    base: [usize; B],
    count: usize,
    /// Indices of the joint's Coulomb and viscous friction among them.
    pub(crate) friction: [Option<usize>; 2],
    /// Number of Stribeck columns after them.
    pub(crate) bank: usize,
    /// Offset of the joint's numbers in a block.
    start: usize,
}

impl<const B: usize> Columns<B> {
    /// Base parameters, in the order of the factor's columns.
    pub(crate) fn base(&self) -> &[usize] {
        self.base.get(..self.count).unwrap_or(&[])
    }

    /// Number of all columns, Stribeck columns included.
    pub(crate) fn all(&self) -> usize {
        self.count + self.bank
    }
}

/// One joint's part of a block.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a, T> {
    /// Packed factor.
    pub(crate) factor: &'a [T],
    /// Sum of the absolute torque, N m.
    pub(crate) absolute_torque: T,
    /// Rows taken.
    pub(crate) rows: T,
}

/// The blocks of one motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Window<T, const N: usize, const B: usize, const NUMBERS: usize> {
    columns: [Columns<B>; N],
    stride: usize,
    capacity: usize,
    /// Slots of the closed blocks, oldest first, then the free slots.
    order: [u8; LARGEST_BLOCKS],
    level: [u8; LARGEST_BLOCKS],
    /// Filter outputs in each slot, including those of joints at rest.
    outputs: [u32; LARGEST_BLOCKS],
    closed: usize,
    /// Index of the pair that is being merged, and the next joint.
    joining: Option<(u8, u8)>,
    numbers: [T; NUMBERS],
}

impl<const N: usize, const B: usize, const NUMBERS: usize> Window<f32, N, B, NUMBERS> {
    /// Empty window without columns: for a static of its own in the device's memory, where it is never moved.
    pub const EMPTY: Self = Self {
        columns: [Columns { base: [0; B], count: 0, friction: [None; 2], bank: 0, start: 0 }; N],
        stride: 0,
        capacity: 0,
        order: [0; LARGEST_BLOCKS],
        level: [0; LARGEST_BLOCKS],
        outputs: [0; LARGEST_BLOCKS],
        closed: 0,
        joining: None,
        numbers: [0.0; NUMBERS],
    };
}

impl<T: Real, const N: usize, const B: usize, const NUMBERS: usize> Window<T, N, B, NUMBERS> {
    /// Empty window without columns.
    pub fn new() -> Self {
        Self {
            columns: [Columns { base: [0; B], count: 0, friction: [None; 2], bank: 0, start: 0 }; N],
            stride: 0,
            capacity: 0,
            order: core::array::from_fn(|slot| slot as u8),
            level: [0; LARGEST_BLOCKS],
            outputs: [0; LARGEST_BLOCKS],
            closed: 0,
            joining: None,
            numbers: [T::zero(); NUMBERS],
        }
    }

    /// Discards all rows.
    pub fn clear(&mut self) {
        (self.stride, self.capacity, self.closed) = (0, 0, 0);
        self.joining = None;
    }

    /// Columns of each joint.
    pub fn columns(&self) -> &[Columns<B>; N] {
        &self.columns
    }

    /// Arranges the columns of a model; discards all blocks.
    pub(crate) fn lay_out(&mut self, model: &RowModel<T, N, B>) {
        let mut all = self.columns;
        for (joint, columns) in all.iter_mut().enumerate() {
            let (mut base, mut count) = ([0; B], 0);
            for index in 0..model.base.rank() {
                let seen = model.base.independent(index).is_some_and(|(carrier, parameter)| {
                    carrier == joint || (carrier > joint && is_of_the_link(parameter))
                });
                if seen {
                    base[count] = index;
                    count += 1;
                }
            }
            let find = |parameter| {
                let seen = base.iter().take(count);
                seen.copied().position(|index| model.base.independent(index) == Some((joint, parameter)))
            };
            let friction = [find(Parameter::FC), find(Parameter::FV)];
            let bank = if model.stribeck_choice(joint).is_possible() { BANK } else { 0 };
            *columns = Columns { base, count, friction, bank, start: 0 };
        }
        self.arrange(all);
    }

    /// Window for tests: every joint has the first `count` columns and the given friction columns.
    #[cfg(test)]
    pub(super) fn with_columns(count: usize, friction: [Option<usize>; 2], bank: usize) -> Self {
        let mut window = Self::new();
        let base = core::array::from_fn(|column| column);
        window.arrange([Columns { base, count, friction, bank, start: 0 }; N]);
        window
    }

    fn arrange(&mut self, columns: [Columns<B>; N]) {
        self.columns = columns;
        let mut start = 0;
        for columns in &mut self.columns {
            columns.start = start;
            start += packed::size(columns.all()) + BESIDE;
        }
        self.stride = start;
        let fits = self.columns.iter().all(|columns| columns.all() <= LARGEST_COLUMNS);
        self.capacity = if fits { (NUMBERS / start.max(1)).min(LARGEST_BLOCKS) } else { 0 };
        self.order = core::array::from_fn(|slot| slot as u8);
        (self.closed, self.joining) = (0, None);
        if self.capacity > 0 {
            self.empty(0);
        }
    }

    /// Makes a slot an open block.
    fn empty(&mut self, slot: usize) {
        if let Some(numbers) = self.numbers.get_mut(slot * self.stride..(slot + 1) * self.stride) {
            numbers.fill(T::zero());
        }
        (self.level[slot], self.outputs[slot]) = (0, 0);
    }

    fn slot(&self, index: usize) -> usize {
        usize::from(self.order[index.min(LARGEST_BLOCKS - 1)])
    }

    /// Takes one output of the row filter; `taken` marks the joints whose row is
    /// used. False without capacity.
    pub(crate) fn insert(&mut self, rows: &FilteredRows<T, N, B>, taken: &[bool; N]) -> bool {
        if self.capacity < 2 {
            return false;
        }
        while self.tidy() {}
        let slot = self.slot(self.closed);
        for joint in (0..N).filter(|&joint| taken[joint]) {
            let columns = self.columns[joint];
            let mut row: Row<T> = [T::zero(); LARGEST_COLUMNS + 1];
            let elements = columns.base().iter().map(|&base| rows.regressor[joint][base]);
            let bank = rows.stribeck[joint].iter().copied().take(columns.bank);
            for (target, element) in
                row.iter_mut().zip(elements.chain(bank).chain(core::iter::once(rows.torque[joint])))
            {
                *target = element;
            }
            let Some(part) = self.part_mut(slot, joint) else { return false };
            packed::rotate(part, columns.all(), &mut row);
            if let [.., absolute, count] = part {
                *absolute += real::abs(rows.torque[joint]);
                *count += T::one();
            }
        }
        self.outputs[slot] += 1;
        if self.outputs[slot] >= BLOCK_ROWS {
            self.end_block();
        }
        true
    }

    /// Ends the open block: the next row starts another.
    pub(crate) fn close(&mut self) {
        while self.tidy() {}
        if self.capacity >= 2 && self.outputs[self.slot(self.closed)] > 0 {
            self.end_block();
        }
        while self.tidy() {}
    }

    fn end_block(&mut self) {
        self.closed += 1;
        if self.closed >= self.capacity {
            self.joining = self.pair_to_join().map(|index| (index as u8, 0));
        } else {
            self.empty(self.slot(self.closed));
        }
    }

    /// Pair of neighbours to merge by the header's rule; where all levels differ, the shortest pair.
    fn pair_to_join(&self) -> Option<usize> {
        let pair = |index: &usize| (self.slot(*index), self.slot(*index + 1));
        let equal = (0..self.closed - 1)
            .filter(|index| self.level[pair(index).0] == self.level[pair(index).1])
            .min_by_key(|index| self.level[pair(index).0]);
        equal.or_else(|| {
            (0..self.closed - 1)
                .min_by_key(|index| self.outputs[pair(index).0].saturating_add(self.outputs[pair(index).1]))
        })
    }

    /// Continues a pending merge by one joint's part of two blocks; true if there was work to do.
    /// [`Self::insert`] does the rest.
    pub(crate) fn tidy(&mut self) -> bool {
        let Some((index, joint)) = self.joining else { return false };
        let (index, joint) = (usize::from(index), usize::from(joint));
        let (merged, freed) = (self.slot(index), self.slot(index + 1));
        self.merge(merged, freed, joint);
        if joint + 1 < N {
            self.joining = Some((index as u8, joint as u8 + 1));
            return true;
        }
        self.level[merged] = self.level[merged].max(self.level[freed]).saturating_add(1);
        self.outputs[merged] = self.outputs[merged].saturating_add(self.outputs[freed]);
        // The freed slot goes behind the closed ones.
        if let Some(younger) = self.order.get_mut(index + 1..self.closed) {
            younger.rotate_left(1);
        }
        self.closed -= 1;
        self.joining = None;
        self.empty(self.slot(self.closed));
        true
    }

    fn merge(&mut self, merged: usize, freed: usize, joint: usize) {
        let columns = self.columns[joint];
        let size = packed::size(columns.all()) + BESIDE;
        let (first, second) = (merged.min(freed) * self.stride, merged.max(freed) * self.stride);
        let Some((low, high)) = self.numbers.split_at_mut_checked(second) else { return };
        let low = low.get_mut(first + columns.start..first + columns.start + size);
        let high = high.get_mut(columns.start..columns.start + size);
        let (Some(low), Some(high)) = (low, high) else { return };
        let (into, from) = if merged < freed { (low, high) } else { (high, low) };
        packed::merge(into, from, columns.all(), T::one());
        if let ([.., absolute, rows], [.., other_absolute, other_rows]) = (into, &mut *from) {
            *absolute += *other_absolute;
            *rows += *other_rows;
        }
        from.fill(T::zero());
    }

    fn part_mut(&mut self, slot: usize, joint: usize) -> Option<&mut [T]> {
        let columns = self.columns.get(joint)?;
        let start = slot * self.stride + columns.start;
        self.numbers.get_mut(start..start + packed::size(columns.all()) + BESIDE)
    }

    /// Number of blocks with rows, including the open one.
    pub(crate) fn blocks(&self) -> usize {
        let open = self.capacity > 1 && self.joining.is_none() && self.outputs[self.slot(self.closed)] > 0;
        self.closed + usize::from(open)
    }

    /// Filter outputs in a block: its length at 50 Hz.
    pub(crate) fn outputs(&self, block: usize) -> u32 {
        self.outputs[self.slot(block)]
    }

    /// One joint's part of a block, oldest block first.
    pub(crate) fn part(&self, block: usize, joint: usize) -> Option<Part<'_, T>> {
        let columns = self.columns.get(joint)?;
        let start = self.slot(block) * self.stride + columns.start;
        let all = self.numbers.get(start..start + packed::size(columns.all()) + BESIDE)?;
        match all {
            [factor @ .., absolute_torque, rows] => {
                Some(Part { factor, absolute_torque: *absolute_torque, rows: *rows })
            }
            _ => None,
        }
    }
}

fn is_of_the_link(parameter: Parameter) -> bool {
    !matches!(parameter, Parameter::IA | Parameter::FC | Parameter::FV | Parameter::OFF)
}

#[cfg(test)]
mod tests;

use super::*;
use heapless::spsc::Queue;
use scarab_boot::{HEADER_AT, Header, seal};

/// Flash of a new image; `fails` is the number of changes until one fails.
struct Memory {
    cells: Vec<u8>,
    fails: Option<u32>,
    swaps: bool,
    confirmed: bool,
    restarts: u32,
}

impl Memory {
    fn new() -> Self {
        let cells = vec![0; Region::IMAGE.bytes() as usize];
        Self { cells, fails: None, swaps: false, confirmed: false, restarts: 0 }
    }

    fn changes(&mut self) -> bool {
        match &mut self.fails {
            Some(0) => false,
            Some(left) => {
                *left -= 1;
                true
            }
            None => true,
        }
    }
}

impl ProgramMemory for Memory {
    fn erase(&mut self, sector: u32) -> bool {
        let bytes = Region::IMAGE.sector_bytes as usize;
        self.cells[sector as usize * bytes..][..bytes].fill(0xFF);
        self.changes()
    }

    fn write(&mut self, offset: u32, word: [u8; 4]) -> bool {
        for (cell, byte) in self.cells[offset as usize..].iter_mut().zip(word) {
            *cell &= byte;
        }
        self.changes()
    }

    fn read(&mut self, offset: u32, into: &mut [u8]) -> bool {
        into.copy_from_slice(&self.cells[offset as usize..][..into.len()]);
        true
    }

    fn request_swap(&mut self) -> bool {
        self.swaps = self.changes();
        self.swaps
    }

    fn confirm(&mut self) -> bool {
        self.confirmed = self.changes();
        self.confirmed
    }

    fn restart(&mut self) {
        self.restarts += 1;
    }
}

struct Bench {
    update: Update,
    signals: Signals<2>,
    memory: Memory,
    queue: Queue<u8, 512>,
}

impl Bench {
    fn new() -> Self {
        Self {
            update: Update::new(false),
            signals: Signals::new(),
            memory: Memory::new(),
            queue: Queue::new(),
        }
    }

    fn step(&mut self) -> Option<bool> {
        self.change(Begun::Stopped)
    }

    fn change(&mut self, begun: Begun) -> Option<bool> {
        self.update.change(begun, &self.signals, &mut self.queue.split().1, &mut self.memory)
    }

    /// Gives a command and runs until it is finished; returns whether the program resumes.
    fn command(&mut self, command: ProgramCommand) -> bool {
        self.signals.command_program(command);
        for _ in 0..1000 {
            assert!(self.signals.program_status().has(ProgramStatus::UNDER_WAY));
            if self.step().is_some() {
                return true;
            }
            if !self.signals.program_status().has(ProgramStatus::UNDER_WAY) {
                return false;
            }
        }
        panic!("the command does not end");
    }

    fn send(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(500) {
            for byte in chunk {
                self.queue.enqueue(*byte).expect("space");
            }
            while !self.queue.is_empty() {
                assert_eq!(self.step(), None);
            }
        }
    }

    fn error(&self) -> u8 {
        self.signals.program_status().error()
    }
}

fn image(length: usize) -> Vec<u8> {
    let mut image: Vec<u8> = (0..length).map(|index| ((index * 13) >> 3) as u8).collect();
    for (index, word) in Header::UNSEALED.into_iter().enumerate() {
        image[HEADER_AT as usize + 4 * index..][..4].copy_from_slice(&word.to_le_bytes());
    }
    seal(&mut image).expect("an image");
    image
}

#[test]
fn an_image_is_written_checked_and_swapped_in() {
    for length in [1000, Region::IMAGE.bytes() as usize] {
        let (mut bench, image) = (Bench::new(), image(length));
        assert!(!bench.command(ProgramCommand::Clear));
        assert!(bench.signals.program_status().has(ProgramStatus::STOPPED | ProgramStatus::CLEARED));
        bench.send(&image);
        assert!(!bench.signals.program_status().has(ProgramStatus::CLEARED));
        assert!(bench.memory.cells.starts_with(&image));
        assert!(!bench.command(ProgramCommand::Start));
        assert_eq!((bench.error(), bench.memory.swaps, bench.memory.restarts), (0, true, 1));
    }
}

#[test]
fn a_damaged_or_incomplete_image_is_refused_and_a_sound_one_accepted_afterwards() {
    let good = image(2000);
    let mut bench = Bench::new();
    let mut damaged = good.clone();
    damaged[700] ^= 4;
    let mut other = good.clone();
    other[HEADER_AT as usize + 4] ^= 1;
    let cases: [(&[u8], ProgramError); 5] = [
        (&damaged, ProgramError::Checksum),
        (&good[..1996], ProgramError::Checksum),
        (&good[..1998], ProgramError::Checksum),
        (&other, ProgramError::Format),
        (&[0; 1000], ProgramError::NoProgram),
    ];
    for (bytes, error) in cases {
        assert!(!bench.command(ProgramCommand::Clear));
        assert_eq!(bench.error(), 0);
        bench.send(bytes);
        assert!(!bench.command(ProgramCommand::Start));
        assert_eq!((bench.error(), bench.memory.swaps), (error as u8, false));
        assert!(bench.signals.program_status().has(ProgramStatus::STOPPED));
        // The next start leaves the update, and the error stays shown.
        let mut leaves = Bench { update: bench.update, ..Bench::new() };
        assert!(leaves.command(ProgramCommand::Start));
        leaves.update.end(false, &leaves.signals);
        assert_eq!(leaves.signals.program_status(), ProgramStatus((error as u32) << 1));
    }
    assert!(!bench.command(ProgramCommand::Clear));
    bench.send(&good);
    assert!(!bench.command(ProgramCommand::Start));
    assert_eq!((bench.error(), bench.memory.restarts), (0, 1));
}

#[test]
fn bytes_without_a_cleared_space_or_beyond_it_are_an_error() {
    let mut bench = Bench::new();
    bench.send(&[1; 8]);
    assert_eq!(bench.error(), ProgramError::NotCleared as u8);
    assert!(bench.memory.cells.iter().all(|cell| *cell == 0), "nothing was written");
    assert!(!bench.command(ProgramCommand::Clear));
    bench.send(&vec![0xA5; Region::IMAGE.bytes() as usize]);
    assert_eq!(bench.error(), 0);
    bench.send(&[1]);
    assert_eq!(bench.error(), ProgramError::NotCleared as u8);
}

#[test]
fn a_flash_that_fails_is_reported_at_each_of_its_changes() {
    let image = image(1000);
    // Two erases, 250 words, the request of the swap.
    for fails in 0..2 + 250 + 1 {
        let mut bench = Bench::new();
        bench.memory.fails = Some(fails);
        bench.command(ProgramCommand::Clear);
        bench.send(&image);
        bench.command(ProgramCommand::Start);
        assert_eq!(bench.memory.restarts, 0, "{fails}");
        assert_ne!(bench.error(), 0, "{fails}");
        assert!(!bench.memory.swaps, "{fails}");
    }
}

#[test]
fn the_program_resumes_where_nothing_was_written() {
    let mut bench = Bench::new();
    assert!(bench.command(ProgramCommand::Start));
    bench.update.end(true, &bench.signals);
    assert_eq!(bench.signals.program_status(), ProgramStatus(0));
    assert_eq!(bench.update.begin(ProgramCommand::Stop, &bench.signals), Some(Begun::Stopped));
    assert!(!bench.command(ProgramCommand::Clear));
    assert!(bench.command(ProgramCommand::Start));
    assert_eq!((bench.memory.restarts, bench.memory.swaps), (0, false));
    assert!(!bench.command(ProgramCommand::Reset));
    assert_eq!(bench.memory.restarts, 1);
}

#[test]
fn a_trial_ends_with_the_confirmation_and_not_where_the_flash_fails() {
    let mut bench = Bench::new();
    bench.update = Update::new(true);
    bench.update.end(true, &bench.signals);
    assert!(bench.signals.program_status().has(ProgramStatus::ON_TRIAL));
    assert_eq!(bench.update.begin(ProgramCommand::Stop, &bench.signals), None, "it would erase the way back");
    assert_eq!(bench.update.begin(ProgramCommand::Start, &bench.signals), Some(Begun::Confirmation));
    assert!(bench.signals.program_status().has(ProgramStatus::UNDER_WAY));
    bench.memory.fails = Some(0);
    assert_eq!(bench.change(Begun::Confirmation), Some(false));
    bench.update.end(false, &bench.signals);
    assert_eq!(bench.error(), ProgramError::Write as u8);
    assert_eq!(bench.update.begin(ProgramCommand::Start, &bench.signals), Some(Begun::Confirmation));
    bench.memory.fails = None;
    assert_eq!(bench.change(Begun::Confirmation), Some(true));
    assert_eq!(bench.update.begin(ProgramCommand::Start, &bench.signals), None);
    bench.update.end(true, &bench.signals);
    assert!(!bench.signals.program_status().has(ProgramStatus::ON_TRIAL));
    assert!(bench.memory.confirmed);
}

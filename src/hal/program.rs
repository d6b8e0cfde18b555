//! Port to the flash of an update.

/// Flash of an update, and the restart. Every function returns whether it succeeded.
pub trait ProgramMemory {
    /// Erases a sector of the new image's space, counted from 0.
    fn erase(&mut self, sector: u32) -> bool;
    /// Programs a word of the new image.
    fn write(&mut self, offset: u32, word: [u8; 4]) -> bool;
    /// Copies bytes of the new image.
    fn read(&mut self, offset: u32, into: &mut [u8]) -> bool;
    /// Requests that the next start swaps the new image in.
    fn request_swap(&mut self) -> bool;
    /// Confirms the running image: it stays.
    fn confirm(&mut self) -> bool;
    /// Restarts the board; returns only in a simulation.
    fn restart(&mut self);
}

//! Large values built where they stay.
//!
//! Why: a value that is returned lives on the stack until it has been moved to its place, often more than once on the way. An
//! identification has 77 KB, and a stack has room for other things.
//!
//! [`fill`] writes every field of a struct into memory that holds nothing yet, and does not compile when one is missing; a field
//! that is large itself is handed its own place. The unsafe code that this takes is written in this file only.

use core::mem::MaybeUninit;

/// `fill!(slot, { field: value, ... }, { field: |place| fill(place), ... })` in an `impl` of the struct: writes each of the first
/// fields, has each of the second written in its place, and gives the struct back.
macro_rules! fill {
    ($slot:expr, { $($field:ident: $value:expr),* $(,)? }, { $($inner:ident: $build:expr),* $(,)? }) => {{
        // Does not compile unless every field is named.
        let _complete = |whole: &Self| {
            let Self { $($field: _,)* $($inner: _),* } = whole;
        };
        let slot: &mut core::mem::MaybeUninit<Self> = $slot;
        let whole = slot.as_mut_ptr();
        $(
            #[expect(unsafe_code, reason = "see `place`")]
            // SAFETY: `whole` points to memory for a `Self` that nobody else reaches, so to that of its field.
            unsafe {
                $crate::place::write(&raw mut (*whole).$field, || $value);
            }
        )*
        $(
            #[expect(unsafe_code, reason = "see `place`")]
            // SAFETY: as above; memory that may hold nothing yet is what a `MaybeUninit` stands for.
            let inner = unsafe { &mut *$crate::place::slot(&raw mut (*whole).$inner) };
            $crate::place::build(inner, $build);
        )*
        #[expect(unsafe_code, reason = "see `place`")]
        // SAFETY: every field was written above: the destructuring names each, the fields handed out were returned filled.
        unsafe {
            slot.assume_init_mut()
        }
    }};
}
pub(crate) use fill;

/// Writes a field; what making it takes of the stack is free for the next.
///
/// # Safety
/// `field` points to memory for the value that nobody else reaches.
#[expect(unsafe_code, reason = "see `place`")]
#[inline(always)]
pub unsafe fn write<T>(field: *mut T, make: impl FnOnce() -> T) {
    /// A compiler that optimises for size gives each value of a function that it does not split a place of its own.
    const SMALL: usize = 128;
    // SAFETY: as this function's.
    unsafe { if const { size_of::<T>() > SMALL } { write_apart(field, make) } else { field.write(make()) } }
}

#[expect(unsafe_code, reason = "see `place`")]
#[inline(never)]
unsafe fn write_apart<T>(field: *mut T, make: impl FnOnce() -> T) {
    // SAFETY: as `write`.
    unsafe { field.write(make()) }
}

/// The memory of a field as the place of a value that is not there yet.
pub const fn slot<T>(field: *mut T) -> *mut MaybeUninit<T> {
    field.cast()
}

/// Has a value built in its place, and nowhere else.
pub fn build<'a, T>(slot: &'a mut MaybeUninit<T>, build: impl FnOnce(&'a mut MaybeUninit<T>) -> &'a mut T) {
    let place = slot.as_mut_ptr();
    let built: *mut T = build(slot);
    assert!(core::ptr::eq(place, built), "what was built lies elsewhere");
}

/// An array, element by element.
#[expect(unsafe_code, reason = "see `place`")]
pub fn each<T, const N: usize>(slot: &mut MaybeUninit<[T; N]>, make: impl Fn() -> T) -> &mut [T; N] {
    let first = slot.as_mut_ptr().cast::<T>();
    for index in 0..N {
        // SAFETY: `first` points to memory for `N` elements, and `index` is below that.
        unsafe { first.add(index).write(make()) };
    }
    // SAFETY: all of its elements were written.
    unsafe { slot.assume_init_mut() }
}

/// A value that is built in a place of its own and moved from there: for those who have the room.
#[expect(unsafe_code, reason = "see `place`")]
pub fn made<T>(build_in: impl for<'a> FnOnce(&'a mut MaybeUninit<T>) -> &'a mut T) -> T {
    let mut slot = MaybeUninit::uninit();
    build(&mut slot, build_in);
    // SAFETY: `build` has seen the value built here.
    unsafe { slot.assume_init() }
}

/// At most one value, built in its place: what `Option` is for values that the stack has no room for.
pub struct Slot<T> {
    full: bool,
    value: MaybeUninit<T>,
}

impl<T> Slot<T> {
    /// Nothing in it.
    pub fn is_empty(&self) -> bool {
        !self.full
    }

    /// Empties it.
    pub fn clear(&mut self) {
        self.full = false;
    }

    /// Has a value built in it, in the place of the one that was there.
    pub fn fill(&mut self, build_in: impl for<'a> FnOnce(&'a mut MaybeUninit<T>) -> &'a mut T) {
        self.full = false;
        build(&mut self.value, build_in);
        self.full = true;
    }

    /// The value.
    #[expect(unsafe_code, reason = "see `place`")]
    pub fn as_ref(&self) -> Option<&T> {
        // SAFETY: `full` is set by `fill` only, once `build` has seen the value built here.
        self.full.then(|| unsafe { self.value.assume_init_ref() })
    }

    /// The value, to be changed.
    #[expect(unsafe_code, reason = "see `place`")]
    pub fn as_mut(&mut self) -> Option<&mut T> {
        // SAFETY: as above.
        self.full.then(|| unsafe { self.value.assume_init_mut() })
    }
}

/// A [`Slot`] that is empty, built in its place.
#[expect(unsafe_code, reason = "see `place`")]
pub fn empty_slot<T>(slot: &mut MaybeUninit<Slot<T>>) -> &mut Slot<T> {
    const { assert!(!core::mem::needs_drop::<T>(), "a value that is overwritten is not dropped") };
    let whole = slot.as_mut_ptr();
    // SAFETY: `whole` points to memory for a `Slot`; its other field may hold anything while this one is false.
    unsafe {
        (&raw mut (*whole).full).write(false);
        slot.assume_init_mut()
    }
}

impl<T: Clone> Clone for Slot<T> {
    fn clone(&self) -> Self {
        let value = self.as_ref().map_or(MaybeUninit::uninit(), |value| MaybeUninit::new(value.clone()));
        Self { full: self.full, value }
    }
}

impl<T: PartialEq> PartialEq for Slot<T> {
    fn eq(&self, other: &Self) -> bool {
        self.as_ref() == other.as_ref()
    }
}

impl<T: core::fmt::Debug> core::fmt::Debug for Slot<T> {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.as_ref().fmt(formatter)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use core::mem::MaybeUninit;

    use super::{Slot, each, empty_slot, made};

    #[derive(Clone, Debug, PartialEq)]
    struct Outer {
        name: Option<u8>,
        none: [Option<u32>; 3],
        inner: Slot<[f32; 100]>,
    }

    impl Outer {
        fn place(slot: &mut MaybeUninit<Self>) -> &mut Self {
            fill!(slot, { name: Some(3) }, { inner: empty_slot, none: |slot| each(slot, || None) })
        }
    }

    #[test]
    fn a_value_built_in_its_place_is_the_value() {
        let mut slot = MaybeUninit::uninit();
        let outer = Outer::place(&mut slot);
        assert_eq!(*outer, Outer { name: Some(3), none: [None; 3], inner: made(|slot| empty_slot(slot)) });
        outer.inner.fill(|slot| slot.write([0.5; 100]));
        let copy = outer.clone();
        assert_eq!((outer.inner.as_ref(), &copy), (Some(&[0.5; 100]), &*outer));
        outer.inner.clear();
        assert!(outer.inner.is_empty() && outer.inner.as_mut().is_none() && copy != *outer);
    }

    #[test]
    #[should_panic(expected = "lies elsewhere")]
    fn what_was_built_elsewhere_is_not_taken() {
        let mut slot: Slot<u32> = made(|slot| empty_slot(slot));
        slot.fill(|_| std::boxed::Box::leak(std::boxed::Box::new(0)));
    }
}

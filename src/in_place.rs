//! Construction of large values in place.
//!
//! Why: a returned value lives on the stack until it has been moved to its destination, often more than once.
//! An identification has 77 KB, too large for the stack.
//!
//! [`fill`] writes every field of a struct into uninitialised memory, and does not compile if one is missing.
//! A field that is large itself gets its own memory to fill. The unsafe code for this is in this file only.

use core::mem::MaybeUninit;

/// `fill!(slot, { field: value, ... }, { field: |slot| fill(slot), ... })` in an `impl` of the struct.
/// Writes each of the first fields, builds each of the second in place, and returns the struct.
macro_rules! fill {
    ($slot:expr, { $($field:ident: $value:expr),* $(,)? }, { $($inner:ident: $build:expr),* $(,)? }) => {{
        // Does not compile unless every field is named.
        let _complete = |whole: &Self| {
            let Self { $($field: _,)* $($inner: _),* } = whole;
        };
        let slot: &mut core::mem::MaybeUninit<Self> = $slot;
        let whole = slot.as_mut_ptr();
        $(
            #[expect(unsafe_code, reason = "see `in_place`")]
            // SAFETY: `whole` points to memory for a `Self` with no other reference
            // to it, so to that of its field.
            unsafe {
                $crate::in_place::write(&raw mut (*whole).$field, || $value);
            }
        )*
        $(
            #[expect(unsafe_code, reason = "see `in_place`")]
            // SAFETY: as above; a `MaybeUninit` may be uninitialised.
            let inner = unsafe { &mut *$crate::in_place::slot(&raw mut (*whole).$inner) };
            $crate::in_place::build(inner, $build);
        )*
        #[expect(unsafe_code, reason = "see `in_place`")]
        // SAFETY: every field was written above: the destructuring names each, the fields handed out were
        // returned filled.
        unsafe {
            slot.assume_init_mut()
        }
    }};
}
pub(crate) use fill;

/// Writes a field; the stack space used to make the value is free for the next.
///
/// # Safety
/// `field` points to memory for the value, with no other reference to it.
#[expect(unsafe_code, reason = "see `in_place`")]
#[inline(always)]
pub(crate) unsafe fn write<T>(field: *mut T, make: impl FnOnce() -> T) {
    /// Largest value written inline, bytes. A size-optimising compiler gives every value of an unsplit
    /// function its own stack slot.
    const SMALL: usize = 128;
    // SAFETY: the caller's contract is that of this function.
    unsafe { if const { size_of::<T>() > SMALL } { write_apart(field, make) } else { field.write(make()) } }
}

#[expect(unsafe_code, reason = "see `in_place`")]
#[inline(never)]
unsafe fn write_apart<T>(field: *mut T, make: impl FnOnce() -> T) {
    // SAFETY: the caller's contract is that of `write`.
    unsafe { field.write(make()) }
}

/// Casts the memory of a field to uninitialised memory for its value.
pub(crate) const fn slot<T>(field: *mut T) -> *mut MaybeUninit<T> {
    field.cast()
}

/// Builds a value in place; panics if the builder returns another address.
pub(crate) fn build<'a, T>(
    slot: &'a mut MaybeUninit<T>,
    build: impl FnOnce(&'a mut MaybeUninit<T>) -> &'a mut T,
) {
    let address = slot.as_mut_ptr();
    let built: *mut T = build(slot);
    assert!(core::ptr::eq(address, built), "what was built lies elsewhere");
}

/// Builds an array, element by element.
#[expect(unsafe_code, reason = "see `in_place`")]
pub(crate) fn each<T, const N: usize>(slot: &mut MaybeUninit<[T; N]>, make: impl Fn() -> T) -> &mut [T; N] {
    let first = slot.as_mut_ptr().cast::<T>();
    for index in 0..N {
        // SAFETY: `first` points to memory for `N` elements, and `index` is below that.
        unsafe { first.add(index).write(make()) };
    }
    // SAFETY: all elements were written.
    unsafe { slot.assume_init_mut() }
}

/// Builds a value in local memory and moves it from there; for callers with enough stack.
#[expect(unsafe_code, reason = "see `in_place`")]
pub(crate) fn made<T>(build_in: impl for<'a> FnOnce(&'a mut MaybeUninit<T>) -> &'a mut T) -> T {
    let mut slot = MaybeUninit::uninit();
    build(&mut slot, build_in);
    // SAFETY: `build` has verified that the value was built here.
    unsafe { slot.assume_init() }
}

/// At most one value, built in place: an `Option` for values that are too large for the stack.
pub(crate) struct Slot<T> {
    full: bool,
    value: MaybeUninit<T>,
}

impl<T> Slot<T> {
    /// True if the slot holds no value.
    pub(crate) fn is_empty(&self) -> bool {
        !self.full
    }

    /// Empties the slot.
    pub fn clear(&mut self) {
        self.full = false;
    }

    /// Builds a value in place and replaces the previous one.
    pub(crate) fn fill(&mut self, build_in: impl for<'a> FnOnce(&'a mut MaybeUninit<T>) -> &'a mut T) {
        self.full = false;
        build(&mut self.value, build_in);
        self.full = true;
    }

    /// Value, if there is one.
    #[expect(unsafe_code, reason = "see `in_place`")]
    pub(crate) fn as_ref(&self) -> Option<&T> {
        // SAFETY: only `fill` sets `full`, after `build` has verified that the value was built here.
        self.full.then(|| unsafe { self.value.assume_init_ref() })
    }

    /// Mutable value, if there is one.
    #[expect(unsafe_code, reason = "see `in_place`")]
    pub(crate) fn as_mut(&mut self) -> Option<&mut T> {
        // SAFETY: as above.
        self.full.then(|| unsafe { self.value.assume_init_mut() })
    }
}

/// Builds an empty [`Slot`] in place.
#[expect(unsafe_code, reason = "see `in_place`")]
pub(crate) fn empty_slot<T>(slot: &mut MaybeUninit<Slot<T>>) -> &mut Slot<T> {
    const { assert!(!core::mem::needs_drop::<T>(), "a value that is overwritten is not dropped") };
    let whole = slot.as_mut_ptr();
    // SAFETY: `whole` points to memory for a `Slot`; its other field may be
    // uninitialised while this one is false.
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
    use core::mem::MaybeUninit;

    use super::{Slot, each, empty_slot, made};

    #[derive(Clone, Debug, PartialEq)]
    struct Outer {
        name: Option<u8>,
        none: [Option<u32>; 3],
        inner: Slot<[f32; 100]>,
    }

    impl Outer {
        fn new_in(slot: &mut MaybeUninit<Self>) -> &mut Self {
            fill!(slot, { name: Some(3) }, { inner: empty_slot, none: |slot| each(slot, || None) })
        }
    }

    #[test]
    fn a_value_built_in_place_equals_the_value() {
        let mut slot = MaybeUninit::uninit();
        let outer = Outer::new_in(&mut slot);
        assert_eq!(*outer, Outer { name: Some(3), none: [None; 3], inner: made(|slot| empty_slot(slot)) });
        outer.inner.fill(|slot| slot.write([0.5; 100]));
        let copy = outer.clone();
        assert_eq!((outer.inner.as_ref(), &copy), (Some(&[0.5; 100]), &*outer));
        outer.inner.clear();
        assert!(outer.inner.is_empty() && outer.inner.as_mut().is_none() && copy != *outer);
    }

    #[test]
    #[should_panic(expected = "lies elsewhere")]
    fn a_value_built_elsewhere_is_refused() {
        let mut slot: Slot<u32> = made(|slot| empty_slot(slot));
        slot.fill(|_| Box::leak(Box::new(0)));
    }
}

//! Macro that turns a list of kinds, with formats and fields, into the type, its writer and its sender.

macro_rules! records {
    ($(
        $(#[$about:meta])*
        $name:ident $format:tt { $( $(#[$what:meta])* $field:ident: $type:ty, )* }
    )*) => {
        /// One record of the trace, for a leg of `N` joints; the keys are the fields' names.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Record<const N: usize> {
            $( $(#[$about])* $name { $( $(#[$what])* $field: $type, )* }, )*
        }

        impl<const N: usize> Record<N> {
            /// Format of every kind, in the order of the list.
            pub const FORMATS: &'static [&'static str] = &[$($format),*];

            /// Writes the line, without its end; `number` is the record's number.
            ///
            /// # Errors
            /// Errors of `out`.
            pub fn write(&self, number: u32, out: &mut dyn Write) -> fmt::Result {
                match self {
                    $( Self::$name { $($field),* } => {
                        fill($format, &[&number as &dyn Value, $($field as &dyn Value),*], out)
                    } )*
                }
            }

            /// Sends the record without waiting; not for use inside a tick. The host
            /// needs the image to decode it.
            #[cfg(feature = "defmt")]
            pub fn emit(&self, number: u32) {
                match self {
                    $( Self::$name { $($field),* } => defmt::info!($format, number, $(*$field),*), )*
                }
            }
        }
    };
}
pub(super) use records;

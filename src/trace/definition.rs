//! From a list of kinds, each with its format and fields, to the type, its writer and its sender.

macro_rules! records {
    ($(
        $(#[$about:meta])*
        $name:ident $format:tt { $( $(#[$what:meta])* $field:ident: $type:ty, )* }
    )*) => {
        /// One thing to tell, of a leg of `N` joints; the keys are the fields' names.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Record<const N: usize> {
            $( $(#[$about])* $name { $( $(#[$what])* $field: $type, )* }, )*
        }

        impl<const N: usize> Record<N> {
            /// The format of every kind, in the order of the list.
            pub const FORMATS: &'static [&'static str] = &[$($format),*];

            /// Writes the line, without its end; `number` is the record's.
            ///
            /// # Errors
            /// Those of `out`.
            pub fn write(&self, number: u32, out: &mut dyn Write) -> fmt::Result {
                match self {
                    $( Self::$name { $($field),* } => {
                        fill($format, &[&number as &dyn Value, $($field as &dyn Value),*], out)
                    } )*
                }
            }

            /// Sends the record; never waits, and is not for a tick. The host that decodes it needs the image.
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

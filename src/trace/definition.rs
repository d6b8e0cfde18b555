//! Macro that turns the list of kinds, with formats and fields, into the type, its writer and its sender.

macro_rules! records {
    ($(
        $(#[$about:meta])*
        $name:ident $format:tt { $( $(#[$what:meta])* $field:ident: $type:ty, )* }
        $( + { $( $(#[$late_what:meta])* $late:ident: $late_type:ty, )* } )?
    )*) => {
        /// One record of the trace, for a leg of `N` joints; the keys are the fields' names.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Record<const N: usize> {
            $( $(#[$about])* $name {
                $( $(#[$what])* $field: $type, )*
                $( $( $(#[$late_what])* $late: $late_type, )* )?
            }, )*
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
                    $( Self::$name { $($field,)* $( $($late,)* )? } => {
                        let values = [&number as &dyn Value, $($field,)* $( $($late,)* )?];
                        fill($format, &values, out)
                    } )*
                }
            }

            /// Sends the record without waiting; not for use inside a tick. The host
            /// needs the image to decode it.
            #[cfg(feature = "defmt")]
            pub fn emit(&self, number: u32) {
                match self {
                    $( Self::$name { $($field,)* $( $($late,)* )? } => {
                        defmt::info!($format, number, $(*$field,)* $( $(*$late,)* )?);
                    } )*
                }
            }
        }

        const _: () = {
            /// Joints; a format does not depend on their number.
            const N: usize = 1;
            $( assert!(
                is_format_of($format, &[
                    $( (stringify!($field), <$type as Hint>::HINT), )*
                    $( $( (stringify!($late), <$late_type as Hint>::HINT), )* )?
                ]),
                concat!("the format of `", stringify!($name), "` is not that of its fields")
            ); )*
        };
    };
}
pub(super) use records;

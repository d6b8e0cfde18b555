//! Enums whose variants are all listed, each with its word.

/// `listed! { pub enum Kind { ALL, name; Variant = 1, "word"; ... } }`: the enum, the constant `ALL` in the
/// order of the variants, and the method `name` for a variant's word. Without the method no variant has a
/// word. Attributes stay with what they precede.
macro_rules! listed {
    ($(#[$outer:meta])* $vis:vis enum $kind:ident {
        $(#[$of_all:meta])* ALL $(, $(#[$of_word:meta])* $word:ident)?;
        $( $(#[$inner:meta])* $name:ident $(= $number:literal)? $(, $text:literal)?; )*
    }) => {
        $(#[$outer])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $vis enum $kind { $( $(#[$inner])* $name $(= $number)?, )* }

        impl $kind {
            $(#[$of_all])*
            pub const ALL: [Self; [$( stringify!($name), )*].len()] = [$( Self::$name, )*];
        }

        $crate::listed::listed! { @word $kind, $( $(#[$of_word])* $word )?; $( $name $( $text )?, )* }
    };
    (@word $kind:ident, ; $( $name:ident, )*) => {};
    (@word $kind:ident, $(#[$of_word:meta])* $word:ident; $( $name:ident $text:literal, )*) => {
        impl $kind {
            $(#[$of_word])*
            pub const fn $word(self) -> &'static str {
                match self { $( Self::$name => $text, )* }
            }
        }
    };
}
pub(crate) use listed;

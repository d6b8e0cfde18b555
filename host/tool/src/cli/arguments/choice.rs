//! Arguments that are one of a few words.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// Word on the command line, its value, and its help; no help where the word says everything.
pub type Choice<T> = (&'static str, T, &'static str);

/// Parser of an argument that is one of these words.
pub fn one_of<T: Copy + Send + Sync>(choices: &'static [Choice<T>]) -> impl TypedValueParser<Value = T> {
    let words = choices.iter().map(|(word, _, help)| match *help {
        "" => PossibleValue::new(*word),
        help => PossibleValue::new(*word).help(help),
    });
    PossibleValuesParser::new(words).try_map(|stated| {
        // Other cases of a word come only from arguments that ignore them.
        let chosen = choices.iter().find(|(word, ..)| word.eq_ignore_ascii_case(&stated));
        chosen.map(|(_, value, _)| *value).ok_or("an unknown word")
    })
}

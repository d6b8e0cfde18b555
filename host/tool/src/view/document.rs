//! Writes sections into a document, each between its markers.
//!
//! Why: measured values in a document stay current because a command writes them. A place begins
//! with the line `<!-- KIND: NAME -->` and ends with `<!-- end of NAME -->`. The text between is
//! replaced; all else stays.

use std::path::Path;

use scarab_base::error::{FileError, ToolError};
use scarab_base::files;

/// Replaces one section of a document; a document without its markers is an error.
pub fn replace(path: &Path, kind: &str, name: &str, content: &str) -> Result<(), ToolError> {
    let text = replaced(&files::read_text(path)?, kind, name, content)
        .ok_or_else(|| no_markers(path, kind, name))?;
    files::write(path, text)
}

/// Returns an error if the document lacks the markers.
pub fn check(path: &Path, kind: &str, name: &str) -> Result<(), ToolError> {
    replaced(&files::read_text(path)?, kind, name, "").map(drop).ok_or_else(|| no_markers(path, kind, name))
}

fn no_markers(path: &Path, kind: &str, name: &str) -> ToolError {
    FileError::new(path.display(), format!("has no `<!-- {kind}: {name} -->` with its end")).into()
}

fn replaced(text: &str, kind: &str, name: &str, content: &str) -> Option<String> {
    let (begin, end) = (format!("<!-- {kind}: {name} -->\n"), format!("<!-- end of {name} -->"));
    let (before, rest) = text.split_once(&begin)?;
    let (_, after) = rest.split_once(&end)?;
    Some(format!("{before}{begin}\n{}\n\n{end}{after}", content.trim()))
}

#[cfg(test)]
mod tests {
    use super::replaced;

    #[test]
    fn only_text_between_the_markers_is_replaced() {
        let text = "a\n<!-- paper: x -->\nold\n<!-- end of x -->\nb\n<!-- paper: y -->\n<!-- end of y -->\n";
        let once = replaced(text, "paper", "x", "new\n").expect("a place");
        assert_eq!(
            once,
            "a\n<!-- paper: x -->\n\nnew\n\n<!-- end of x -->\nb\n<!-- paper: y -->\n<!-- end of y -->\n"
        );
        assert_eq!(replaced(&once, "paper", "x", "new\n").as_ref(), Some(&once));
        assert_eq!(replaced(text, "paper", "z", "new"), None);
    }
}

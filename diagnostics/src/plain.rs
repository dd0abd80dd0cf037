//! Messages of the system and of libraries, in words.

use std::borrow::Cow;

/// Messages of libraries, and the same for people who do not know Rust.
const WORDS: [(&str, &str); 5] = [
    ("stream did not contain valid UTF-8", "it is not UTF-8 text"),
    ("invalid digit found in string", "it is not a whole number"),
    ("cannot parse integer from empty string", "it is empty, expected a whole number"),
    ("number too large to fit in target type", "the number is too large"),
    ("invalid float literal", "it is not a number"),
];
/// Begin of the number that the system has for an error, behind its message.
const CODE: &str = " (os error ";

/// Returns the text of an error in words: without the system's numbers of errors, and without the words of libraries.
///
/// ```
/// let shown = diagnostics::plain("cannot read a.toml: No such file or directory (os error 2)");
/// assert_eq!(shown, "cannot read a.toml: No such file or directory");
/// assert_eq!(diagnostics::plain("a: stream did not contain valid UTF-8"), "a: it is not UTF-8 text");
/// ```
#[must_use]
pub fn plain(text: &str) -> Cow<'_, str> {
    let mut shown = Cow::Borrowed(text);
    for (from, to) in WORDS {
        if shown.contains(from) {
            shown = shown.replace(from, to).into();
        }
    }
    while let Some(start) = shown.find(CODE) {
        let code = &shown[start + CODE.len()..];
        let digits = code.bytes().take_while(u8::is_ascii_digit).count();
        if digits == 0 || !code[digits..].starts_with(')') {
            break;
        }
        let end = start + CODE.len() + digits + 1;
        shown = format!("{}{}", &shown[..start], &shown[end..]).into();
    }
    shown
}

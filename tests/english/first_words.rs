//! Doc comments of this repository begin with a noun or a verb, not with a question word.
//!
//! The first line of a comment and the first line of each of its paragraphs count. Their other lines are free.

use crate::sources::{Source, doc_line, rust_files};

/// Words that no paragraph of a doc comment begins with.
const QUESTIONS: [&str; 8] = ["What", "Whatever", "Who", "Whether", "How", "Which", "Where", "Why"];

/// True if a text begins with one of [`QUESTIONS`].
fn is_question(content: &str) -> bool {
    // Items of a list and cells of a table begin behind their marks.
    let content = content.trim_start_matches(['-', '*', '|', ' ']);
    let first = content.split(|c: char| !c.is_alphabetic()).next().unwrap_or_default();
    QUESTIONS.contains(&first)
}

/// Numbers of the lines of `text`, from 1, in which a paragraph of a doc comment begins with a question word.
fn questions(text: &str) -> Vec<usize> {
    let mut found = Vec::new();
    // The marker of the paragraph that the line before belongs to.
    let mut paragraph = None;
    let mut is_code = false;
    for (number, line) in (1..).zip(text.lines()) {
        let doc = doc_line(line).filter(|(_, content)| !content.is_empty());
        if doc.is_some_and(|(_, content)| content.starts_with("```")) {
            is_code = !is_code;
        }
        if is_code {
            continue;
        }
        if let Some((marker, content)) = doc
            && paragraph != Some(marker)
            && is_question(content)
        {
            found.push(number);
        }
        paragraph = doc.map(|(marker, _)| marker);
    }
    found
}

#[test]
fn doc_comments_begin_with_a_noun_or_a_verb() {
    let mut found = String::new();
    for Source { path, text } in rust_files() {
        for number in questions(&text) {
            found += &format!("{path}:{number}: {}\n", text.lines().nth(number - 1).unwrap().trim());
        }
    }
    assert!(
        found.is_empty(),
        "begin these with a noun (\"Number of …\", \"True if …\") or a verb (\"Returns …\"):\n{found}"
    );
}

#[test]
fn a_question_word_that_begins_a_paragraph_is_found() {
    let cases: [(&str, &str, &[usize]); 12] = [
        ("the first line", "/// What it reads.\nfn a() {}\n", &[1]),
        ("a line of a module", "//! How it flies.\n\n//! Why.\n", &[1, 3]),
        ("an indented line", "struct A {\n    /// Whether it flies.\n    a: bool,\n}\n", &[2]),
        ("a paragraph behind a blank line", "/// Flies.\n///\n/// Where it lands is open.\n", &[3]),
        ("a paragraph behind code", "/// Number of ticks.\nconst N: u8 = 1;\n/// Which rotor.\n", &[3]),
        ("another marker", "//! Rotors.\n/// Who turns them.\n", &[2]),
        ("each word", "/// Whatever.\n\n/// Who\n\n/// Which: this.\n", &[1, 3, 5]),
        ("an item of a list", "/// Inputs:\n///\n/// - What it reads\n", &[3]),
        ("code", "/// Example:\n///\n/// ```text\n///\n/// What it prints\n/// ```\n", &[]),
        ("a noun", "/// Inputs.\n///\n/// Whole numbers, whichever.\nstruct Whatever;\n", &[]),
        ("a line that goes on", "/// Reads the inputs.\n/// What it reads is kept.\n", &[]),
        ("other comments", "// What it reads.\n//// Why.\nlet what = \"/// What\"; // How.\n", &[]),
    ];
    for (what, text, expected) in cases {
        assert_eq!(questions(text), expected, "{what}");
    }
}

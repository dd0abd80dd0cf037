//! Sentences of pages and doc comments have at most 25 words; the number of longer ones only sinks.

use crate::sentences::{Sentence, sentences};
use crate::sources::{Source, doc_line, pages, rust_files};
use std::fmt::Write as _;
use std::io::Write as _;

/// Number of words of the longest sentence that is not counted.
const WORDS_MAX: usize = 25;

/// Number of longer sentences in README, CONTRIBUTING and docs. Lower it when there are fewer; never raise it.
const IN_PAGES: usize = 0;

/// The same in doc comments.
const IN_DOC_COMMENTS: usize = 0;

/// Returns the doc comments of a Rust file, each in the line that it has there.
fn doc_comments(text: &str) -> String {
    let contents = text.lines().map(|line| doc_line(line).map_or("", |(_, content)| content));
    contents.flat_map(|content| [content, "\n"]).collect()
}

/// Returns the sentences of a text that are too long.
fn long_sentences(text: &str) -> Vec<Sentence> {
    let mut found = sentences(text);
    // Words have two bytes with their blanks at least: most sentences are too short to be counted.
    found.retain(|sentence| sentence.text.len() > 2 * WORDS_MAX && sentence.words() > WORDS_MAX);
    found
}

/// Requires that `sources` have at most `ceiling` long sentences. Says so if they have fewer.
fn require(what: &str, name: &str, sources: &[Source], ceiling: usize) {
    let mut counts = String::new();
    let mut lines = String::new();
    let mut count = 0;
    for Source { path, text } in sources {
        let found = long_sentences(text);
        count += found.len();
        if !found.is_empty() {
            writeln!(counts, "{:4} {path}", found.len()).unwrap();
        }
        for sentence in found {
            let Sentence { line, text } = &sentence;
            writeln!(lines, "{path}:{line}: {} words: {text}", sentence.words()).unwrap();
        }
    }
    assert!(
        count <= ceiling,
        "{count} sentences of {what} have more than {WORDS_MAX} words, where {ceiling} are allowed: shorten those \
         that you wrote.\n{lines}\n{counts}"
    );
    if count < ceiling {
        let advice =
            format!("{what} have {count} long sentences: lower {name} in {} from {ceiling}\n", file!());
        // Not by `eprintln`, which the harness hides for a test that passes.
        std::io::stderr().write_all(advice.as_bytes()).unwrap();
    }
}

#[test]
fn pages_have_no_more_long_sentences_than_before() {
    require("pages", "IN_PAGES", &pages(), IN_PAGES);
}

#[test]
fn doc_comments_have_no_more_long_sentences_than_before() {
    let mut files = rust_files();
    files.iter_mut().for_each(|file| file.text = doc_comments(&file.text));
    require("doc comments", "IN_DOC_COMMENTS", &files, IN_DOC_COMMENTS);
}

#[test]
fn the_26th_word_makes_a_sentence_too_long() {
    let words = |count: usize| vec!["word"; count].join(" ");
    assert_eq!(long_sentences(&format!("{}. {}.", words(25), words(25))), []);
    let found = long_sentences(&format!("\n{}.\n", words(26)));
    assert_eq!((found.len(), found[0].line, found[0].words()), (1, 2, 26));
}

#[test]
fn doc_comments_keep_their_lines() {
    let text = "//! Room.\n\nuse a; // no doc\n/// One\n/// two.\n///\n/// Three.\nfn a() {}\n    //! Four.\n//// no doc\n";
    assert_eq!(doc_comments(text), "Room.\n\n\nOne\ntwo.\n\nThree.\n\nFour.\n\n");
}

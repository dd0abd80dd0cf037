//! English of pages and doc comments, as far as it can be counted.

mod first_words;
mod length;
mod sentences;
mod sources;

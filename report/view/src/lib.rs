//! Recordings in the browser: a server on the loopback, and the page that it serves.
//!
//! | room | content |
//! |---|---|
//! | [`shown`] | a recording that is shown, with its index by time |
//! | [`fields`] | the fields of its topics, and messages read for some of them |
//! | [`frames`] | the newest values at evenly spaced times, as the room shows them |
//! | [`curves`] | the lowest and highest values in intervals of time, as scopes draw them |
//! | [`overview`] | the same over the whole recording, read once in the background |
//! | [`catalogue`] | everything that the page needs to know before it requests values |
//! | `vehicles`, `marks` | the vehicles of a recording; its swaps and pass conditions |
//! | `entry` | a recording of the server, which keeps up with its growth |
//! | `readers` | threads that read recordings, a few at the same time |
//! | `assets` | the files of the page, part of this program |
//! | [`live`] | the live run behind a page: its state, and the requests of the page |
//! | `newest` | the newest values of that run, ahead of its recording |
//! | `schedule` | the tick of that run as planned, and as it goes |
//! | `take_overs` | the processes of that run that took over from others |
//! | `layouts` | the layouts of scopes that a user keeps |
//! | `pages` | the pages that are open, and their events |
//! | `gate` | requests that are let in |
//! | [`server`] | the server: addresses and their answers |
//! | [`browser`] | the user's browser |
//! | [`foxglove_server`] | a live run in Foxglove and Lichtblick |
//! | `priority` | the priority of the threads that serve watchers |
//!
//! Times that the page sends and gets are nanoseconds since the recording's first message.
#![forbid(unsafe_code)]

mod assets;
pub mod browser;
pub mod catalogue;
pub mod curves;
mod entry;
pub mod fields;
pub mod foxglove_server;
pub mod frames;
mod gate;
mod layouts;
pub mod live;
mod marks;
mod newest;
pub mod overview;
mod pages;
mod priority;
mod readers;
mod schedule;
pub mod server;
pub mod shown;
mod take_overs;
#[cfg(test)]
mod tests;
mod vehicles;

pub use server::{Handle, Server};
pub use shown::Shown;

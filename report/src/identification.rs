//! What an identification found: its page, and its predictions held against the same flown on the bus.

mod on_bus;
mod page;

pub use on_bus::fly_again;
pub use page::page;

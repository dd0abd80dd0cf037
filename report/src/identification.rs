//! Results of an identification: its page, and its predictions compared with flights on the bus.

mod on_bus;
mod page;

pub use on_bus::fly_again;
pub use page::page;

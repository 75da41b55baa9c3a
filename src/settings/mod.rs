//! The settings describe themselves: sentences from the doc comments of the code, limits and units from the
//! ranges that the loader checks. TOML with comments, a JSON Schema and a reference page are made from both.
//! See docs/adr/0036-settings.md.

pub mod check;
mod commented;
mod complete;
mod describe;
mod header;
mod reference;
mod schema;

pub use commented::commented;
pub use reference::reference;
pub use schema::schema;

#[cfg(test)]
mod tests;

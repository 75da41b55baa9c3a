//! Nothing, instead of bindgen and its fifteen crates.
//!
//! The build scripts of iceoryx2 0.10 depend on bindgen on every platform and call it on QNX only
//! (`iceoryx2-pal-posix/build.rs`). See docs/adr/0040-build.md.

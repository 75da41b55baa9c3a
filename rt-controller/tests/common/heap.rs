//! Counts heap operations: those of the calling thread, or of another one that is watched.
//!
//! A test that counts names the allocator:
//! `#[global_allocator] static ALLOCATOR: CountingAllocator = CountingAllocator;`

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicI32, AtomicU64, Ordering};

pub struct CountingAllocator;

thread_local! {
    static OWN: Cell<Option<u64>> = const { Cell::new(None) };
}
/// The thread that is watched, or 0, and its operations.
static WATCHED: AtomicI32 = AtomicI32::new(0);
static OPERATIONS: AtomicU64 = AtomicU64::new(0);

fn count() {
    // A thread that is ending has no counter left; it is not counting either.
    let _ = OWN.try_with(|n| n.set(n.get().map(|n| n + 1)));
    let watched = WATCHED.load(Ordering::Relaxed);
    if watched != 0 && watched == this_thread() {
        OPERATIONS.fetch_add(1, Ordering::Relaxed);
    }
}

#[allow(unsafe_code)]
// SAFETY: every call goes to the system allocator unchanged.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Those of `f`, on this thread.
pub fn operations_of(f: impl FnOnce()) -> u64 {
    OWN.set(Some(0));
    f();
    OWN.replace(None).unwrap()
}

pub fn this_thread() -> i32 {
    rustix::thread::gettid().as_raw_nonzero().get()
}

/// From now on this thread is watched, and no other.
pub fn watch(thread: i32) {
    WATCHED.store(thread, Ordering::Relaxed);
}

pub fn watch_nobody() {
    watch(0);
}

/// Operations of the watched threads so far.
pub fn operations() -> u64 {
    OPERATIONS.load(Ordering::Relaxed)
}

pub fn forget_operations() {
    OPERATIONS.store(0, Ordering::Relaxed);
}

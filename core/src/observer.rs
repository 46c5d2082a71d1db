//! Who watches schedules of this very source, access by access. Compiled under shuttle only.
//!
//! All threads of a schedule are on one of the operating system's, to which everything here is local.

use std::cell::Cell;

use crate::sync::{Access, Site, let_others_run, site};

/// Told of each access ahead of it: its site, what it does, and the address of its word. It decides where others run.
pub type Observer = fn(Site, Access, usize);

std::thread_local! {
    static OBSERVER: Cell<Option<Observer>> = const { Cell::new(None) };
}

/// Has everything from now on watched; `None` lets shuttle schedule by itself again.
pub fn watch(observer: Option<Observer>) {
    OBSERVER.set(observer);
}

/// Without an observer others may run first, unless the protocol keeps all others away from what is accessed: between two
/// accesses that race, those make no difference.
pub(crate) fn before(site: Site, access: Access, word: usize) {
    const UNDISTURBED: [Site; 6] = [
        site::EXCLUSIVE,
        site::LIST_LINK,
        site::LIST_FOLLOW,
        site::CANDIDATE_HEAD,
        site::SLOT_FIELD,
        site::FRAME_TAG,
    ];
    if let Some(observer) = OBSERVER.get() {
        observer(site, access, word);
    } else if !UNDISTURBED.iter().any(|undisturbed| undisturbed.name == site.name) {
        let_others_run();
    }
}

//! What is to happen when a thread panics.

use std::thread;

/// Calls if its thread panics while it lives: others would wait for what that thread had in hand, or take what it left
/// for whole.
pub(crate) struct OnPanic<F: Fn()>(pub(crate) F);

impl<F: Fn()> Drop for OnPanic<F> {
    fn drop(&mut self) {
        if thread::panicking() {
            (self.0)();
        }
    }
}

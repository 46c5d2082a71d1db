//! What is to happen when a thread panics.

use std::thread;

/// Calls if its thread panics while it lives: others would wait for what that thread had in hand, or take what it left
/// for whole.
pub(crate) struct OnPanic<F: Fn()> {
    call: F,
    /// A destructor that a panic runs is no panic of its own: it may go on, and end well.
    panicked_before: bool,
}

impl<F: Fn()> OnPanic<F> {
    pub(crate) fn new(call: F) -> Self {
        Self { call, panicked_before: thread::panicking() }
    }
}

impl<F: Fn()> Drop for OnPanic<F> {
    fn drop(&mut self) {
        if thread::panicking() && !self.panicked_before {
            (self.call)();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;

    struct InDestructor<'c>(&'c Cell<u32>);

    impl Drop for InDestructor<'_> {
        fn drop(&mut self) {
            drop(OnPanic::new(|| self.0.set(self.0.get() + 1)));
        }
    }

    #[test]
    fn a_panic_while_it_lives_and_no_other() {
        let calls = Cell::new(0);
        drop(OnPanic::new(|| calls.set(calls.get() + 1)));
        assert_eq!(calls.get(), 0, "no panic");
        let panics = |work: &dyn Fn()| catch_unwind(AssertUnwindSafe(work)).is_err();
        assert!(panics(&|| {
            let _in_destructor = InDestructor(&calls);
            panic!("outside");
        }));
        assert_eq!(calls.get(), 0, "a panic from before");
        assert!(panics(&|| {
            let _guard = OnPanic::new(|| calls.set(calls.get() + 1));
            panic!("inside");
        }));
        assert_eq!(calls.get(), 1);
    }
}

//! The render token (§5.3): whoever holds it renders and swaps, nobody else. Or the renderer is left to all workers,
//! and whoever has taken it does.

use crate::sync::{Atomic, CachePadded, Cell, const_fn, seeded, site};

/// The right to render, and the host's graphics context with it.
///
/// A token is issued by [`crate::pipeline::Pipeline::token`], and there is a limited number at once; it can
/// be neither cloned nor built elsewhere, so it cannot be forged or doubled. It may move from
/// worker to worker, and the renderer moves along. One that is forgotten (`mem::forget`) is never given back.
#[derive(Debug)]
#[must_use = "dropping it drops the renderer"]
pub struct Token<'p, R> {
    renderer: R,
    permit: Permit<'p>,
}

/// One of the tokens that an office may have out.
#[derive(Debug)]
struct Permit<'p>(&'p TokenOffice);

impl<'p, R> Token<'p, R> {
    /// Whether this token was issued by `office`: it renders no other pipeline's frames.
    pub(crate) fn is_from(&self, office: &TokenOffice) -> bool {
        ::core::ptr::eq(self.permit.0, office) || seeded!(ForeignToken)
    }

    /// The graphics context.
    pub fn renderer(&mut self) -> &mut R {
        &mut self.renderer
    }

    /// Gives the token up and the graphics context back.
    #[must_use = "dropping it drops the renderer"]
    pub fn into_renderer(self) -> R {
        self.renderer
    }
}

impl Drop for Permit<'_> {
    fn drop(&mut self) {
        self.0.left.fetch_add(1, site::TOKEN_COUNT);
    }
}

/// Issues tokens and takes them back.
#[derive(Debug)]
pub(crate) struct TokenOffice {
    left: Atomic,
}

impl TokenOffice {
    const_fn! {
        pub(crate) const fn new(tokens: u32) -> Self {
            Self { left: Atomic::new(tokens) }
        }
    }

    /// Takes all tokens at once, if none of them is out and there are any.
    pub(crate) fn close(&mut self, tokens: u32) -> bool {
        let closes = tokens > 0 && self.left.load(site::EXCLUSIVE) == tokens;
        if closes {
            self.left.store(0, site::EXCLUSIVE);
        }
        closes
    }

    /// Has them all again.
    pub(crate) fn open(&mut self, tokens: u32) {
        self.left.store(tokens, site::EXCLUSIVE);
    }

    /// A token for `renderer`, or `renderer` back if all are out.
    pub(crate) fn issue<R>(&self, renderer: R) -> Result<Token<'_, R>, R> {
        let mut left = self.left.load(site::COUNT_LOOK);
        while left > 0 {
            match self.left.exchange(left, left - 1, site::TOKEN_COUNT) {
                Err(found) if !seeded!(DoubledToken) => left = found,
                _ => return Ok(Token { renderer, permit: Permit(self) }),
            }
        }
        Err(renderer)
    }
}

/// A renderer that is left to all workers: whoever has something to render takes it, and puts it back when nothing
/// is left to render. At most one has it at a time.
pub(crate) struct Shared<R> {
    /// 1 if nobody has it.
    free: CachePadded<Atomic>,
    renderer: Cell<Option<R>>,
    /// Whether there is one; changed by exclusive access only.
    offered: bool,
}

// SAFETY: only a renderer that may go from thread to thread gets in (`Pipeline::share`); it is lent to one worker
// at a time, who took it.
unsafe impl<R> Sync for Shared<R> {}
// SAFETY: as above.
unsafe impl<R> Send for Shared<R> {}

impl<R> Shared<R> {
    pub(crate) fn new() -> Self {
        Self { free: CachePadded::new(Atomic::new(0)), renderer: Cell::new(None), offered: false }
    }

    /// Leaves `renderer` to all.
    pub(crate) fn offer(&mut self, renderer: R) {
        *self.renderer.get_mut() = Some(renderer);
        self.offered = true;
        self.free.store(1, site::EXCLUSIVE);
    }

    /// Leaves it to nobody any more.
    pub(crate) fn withdraw(&mut self) -> Option<R> {
        self.free.store(0, site::EXCLUSIVE);
        self.offered = false;
        self.renderer.get_mut().take()
    }

    /// Nobody has it: by exclusive access no worker is left, though one that was forgotten may have had it.
    pub(crate) fn regain(&mut self) {
        self.free.store(u32::from(self.offered), site::EXCLUSIVE);
    }

    #[inline]
    pub(crate) fn is_offered(&self) -> bool {
        self.offered
    }

    /// Whether nobody has it: a hint.
    #[inline]
    pub(crate) fn is_free(&self) -> bool {
        self.offered && self.free.load(site::SHARED_LOOK) == 1
    }

    /// Whether the caller has it from now on.
    #[inline]
    pub(crate) fn take(&self) -> bool {
        self.is_free() && self.free.exchange(1, 0, site::SHARED_TAKE).is_ok()
    }

    /// The caller, who has it, puts it back. Before it does other work, sleeps or leaves it has to look again for
    /// something to render, behind a fence: whoever queued that before may have found it taken.
    #[inline]
    pub(crate) fn put_back(&self) {
        self.free.store(1, site::SHARED_PUT);
    }

    /// Lends it.
    ///
    /// # Safety
    /// The caller has it.
    #[inline]
    pub(crate) unsafe fn with_mut<T>(&self, f: impl FnOnce(Option<&mut R>) -> T) -> T {
        // SAFETY: whoever has it is alone with it; the caller does.
        unsafe { self.renderer.with_mut(|renderer| f(renderer.as_mut())) }
    }
}

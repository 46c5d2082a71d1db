//! The render token (§5.3): whoever holds it renders and swaps, nobody else.

use crate::sync::{Atomic, const_fn, seeded, site};

/// The right to render, and the host's graphics context with it.
///
/// A token is issued by [`crate::pipeline::Pipeline::token`], a limited number of times; it can
/// be neither cloned nor built elsewhere, so it cannot be forged or doubled. It may move from
/// worker to worker, and the renderer moves along.
#[derive(Debug)]
pub struct Token<'p, R> {
    pub(crate) renderer: R,
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

//! The render token: never doubled, and what it guards moves from holder to holder.

use super::ve::{Setup, build};
use super::{Guarded, Model, Role, check, lend, together};
use dualframe_core_model::storage::Static;

pub(crate) const ALL: &[Model] =
    &[("token::never_doubled", never_doubled), ("token::static_once", static_once)];

/// Two hosts ask for the only token and change what it guards while they have it. Both get it, one
/// after the other, or one is refused.
fn never_doubled() {
    let expected = [[true, true], [true, false], [false, true]];
    check("token::never_doubled", None, 2, expected, |order| {
        let (pipeline, _) = build(Setup { units: 1, ..Setup::default() });
        let context = &*lend(Guarded::new(0));
        let role = || -> Role<bool> {
            Box::new(move || {
                let token = pipeline.token(context);
                let got = token.is_ok();
                if let Ok(mut token) = token {
                    let context = token.renderer();
                    context.set(context.get() + 1);
                }
                got
            })
        };
        let got = together(order, vec![role(), role()]);
        assert_eq!(context.get(), got.iter().filter(|&&got| got).count() as u32);
        [got[0], got[1]]
    });
}

/// A static is handed out once.
fn static_once() {
    check("token::static_once", None, 2, [[true, false], [false, true]], |order| {
        let value: &'static Static<u32> = lend(Static::new(1));
        let role = || -> Role<bool> {
            Box::new(move || {
                let taken = value.take();
                let got = taken.is_some();
                if let Some(taken) = taken {
                    *taken += 1;
                }
                got
            })
        };
        let got = together(order, vec![role(), role()]);
        [got[0], got[1]]
    });
}

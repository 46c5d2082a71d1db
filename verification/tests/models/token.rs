//! The render token: never doubled, and what it guards moves from holder to holder.

use super::ve::{Screen, Setup, build};
use super::{Guarded, Model, Role, check, lend, together};
use dualframe_core_model::storage::Static;

pub(crate) const ALL: &[Model] = &[
    ("token::never_doubled", never_doubled),
    ("token::foreign_is_refused", foreign_is_refused),
    ("token::static_once", static_once),
];

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

/// A token renders the frames of the pipeline that issued it, and no other's.
fn foreign_is_refused() {
    check("token::foreign_is_refused", None, 1, [[true, false]], |_| {
        let setup = Setup { units: 1, ..Setup::default() };
        [true, false].map(|own| {
            let (pipeline, _) = build(setup);
            let issuer = if own { pipeline } else { build(setup).0 };
            let screen: Screen = lend(Guarded::new(0));
            let Ok(token) = issuer.token(screen) else { panic!("a token is left") };
            pipeline.worker().hold(token).is_ok()
        })
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

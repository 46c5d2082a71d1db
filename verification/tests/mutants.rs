//! Each model is able to fail: every memory order of the core that is not Relaxed is weakened by
//! one step, alone, and some model must notice.
//!
//! The weakened site is global to a process, so this is a test binary of its own, with one test.

mod models;

use dualframe_core_model::sync::{Site, mutant::weaken, site};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering::{self, AcqRel, Acquire, Relaxed, Release, SeqCst};

/// Mutants that no model notices, each with the reason why the site may stay as it is.
const EXPECTED_SURVIVORS: &[(&str, Ordering, &str)] = &[];

/// The models to try on a site, by the start of its name; the first that fails ends the search.
fn suspects(name: &str) -> Vec<models::Model> {
    let lists: &[&[models::Model]] = match name.split('_').next().unwrap_or_default() {
        "RING" => &[models::ring::ALL],
        "COUNTDOWN" => &[models::countdown::ALL],
        "ARRIVALS" => &[models::arrivals::ALL],
        "MAIL" => &[models::inbox::ALL],
        "LATEST" | "READERS" => &[models::latest::ALL],
        "BELL" | "FENCE" => &[models::bell::ALL],
        "TOKEN" | "STATIC" => &[models::token::ALL],
        "DISPLAY" => &[models::pipeline::ALL],
        _ => &[],
    };
    assert!(!lists.is_empty(), "no model is assigned to {name}");
    lists.iter().copied().flatten().copied().collect()
}

/// One step weaker, in each direction.
fn weaker(order: Ordering) -> &'static [Ordering] {
    match order {
        SeqCst => &[AcqRel, Relaxed],
        AcqRel => &[Acquire, Release],
        Acquire | Release => &[Relaxed],
        _ => &[],
    }
}

/// The first model that fails, with `site` at `order`.
fn killer(site: Site, order: Ordering) -> Option<&'static str> {
    weaken(Some((site, order)));
    let failed = |&(_, model): &models::Model| catch_unwind(AssertUnwindSafe(model)).is_err();
    let killer = suspects(site.name).into_iter().find(failed);
    weaken(None);
    killer.map(|(name, _)| name)
}

#[test]
fn every_ordering_is_load_bearing() {
    std::panic::set_hook(Box::new(|_| ()));
    let (mut table, mut wrong) = (String::new(), Vec::new());
    for &site in site::ALL {
        for &order in weaker(site.order) {
            let killer = killer(site, order);
            let excuse = EXPECTED_SURVIVORS
                .iter()
                .find(|(name, at, _)| (*name, *at) == (site.name, order))
                .map(|(.., reason)| *reason);
            if killer.is_some() == excuse.is_some() {
                wrong.push(format!("{} at {order:?}: {killer:?}, {excuse:?}", site.name));
            }
            let verdict = killer.or(excuse).unwrap_or("NOBODY");
            table += &format!("| {} | {:?} | {order:?} | {verdict} |\n", site.name, site.order);
        }
    }
    let _ = std::panic::take_hook();
    println!("| site | order | mutant | killed by |\n|---|---|---|---|\n{table}");
    assert!(wrong.is_empty(), "unexpected: {wrong:#?}");
}

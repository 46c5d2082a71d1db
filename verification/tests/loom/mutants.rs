//! Each order is noticed: every memory order of the core that is not Relaxed is weakened by one step, alone, and
//! some model must fail. A fence is weakened to none as well.

use crate::models::hunt::{Kill, each, kill};
use crate::models::{
    Model, arrivals, bell, countdown, inbox, latest, offer, pipeline, ring, shared, token,
};
use dualframe_core_model::instrument::weaken;
use dualframe_core_model::sync::{Site, site};
use std::sync::atomic::Ordering::{self, AcqRel, Acquire, Relaxed, Release, SeqCst};

/// Mutants that no model notices, each with the reason why the site may stay as it is.
const EXPECTED_SURVIVORS: &[(&str, Ordering, &str)] = &[];

/// The models to try on a site, by the start of its name; the first that fails ends the search.
fn suspects(name: &str) -> &'static [Model] {
    match name.split('_').next().unwrap_or_default() {
        "FENCE" if name == site::FENCE_PUT_BACK.name => shared::ALL,
        "RING" => ring::ALL,
        "COUNTDOWN" => countdown::ALL,
        "ARRIVALS" => arrivals::ALL,
        "OFFER" => offer::ALL,
        "MAIL" => inbox::ALL,
        "LATEST" | "READERS" => latest::ALL,
        "BELL" | "FENCE" => bell::ALL,
        "TOKEN" | "STATIC" => token::ALL,
        "SHARED" => shared::ALL,
        "DISPLAY" => pipeline::ALL,
        "PENDING" => pipeline::SEVERAL_INTERACTIONS,
        _ => panic!("no model is assigned to {name}"),
    }
}

/// One step weaker, in each direction. A fence cannot be Relaxed: that is none.
fn weaker(order: Ordering) -> &'static [Ordering] {
    match order {
        SeqCst => &[AcqRel, Relaxed],
        AcqRel => &[Acquire, Release],
        Acquire | Release => &[Relaxed],
        _ => &[],
    }
}

/// The first model that fails with `site` at `order`, how it did, and how often others ran before.
fn killer((site, order): (Site, Ordering)) -> Option<(&'static str, Kill)> {
    weaken(Some((site, order)));
    let mut tried = suspects(site.name).iter();
    tried.find_map(|&(name, model)| kill(model).map(|kill| (name, kill)))
}

#[test]
fn every_ordering_is_load_bearing() {
    let mutants: Vec<_> = site::ALL
        .iter()
        .flat_map(|&site| weaker(site.order).iter().map(move |&order| (site, order)))
        .collect();
    let mut wrong = Vec::new();
    println!("| site | order | mutant | killed by | executions | how |\n|---|---|---|---|---|---|");
    for ((site, order), killer) in mutants.iter().zip(each(&mutants, killer)) {
        let excuse = EXPECTED_SURVIVORS
            .iter()
            .find(|(name, at, _)| (*name, *at) == (site.name, *order))
            .map(|(.., reason)| *reason);
        let verdict = match (&killer, excuse) {
            (Some((model, kill)), _) => format!("`{model}` | {kill}"),
            (None, excuse) => format!("{} | - | -", excuse.unwrap_or("NOBODY")),
        };
        if killer.is_some() == excuse.is_some() {
            wrong.push(format!("{} at {order:?}: {verdict}", site.name));
        }
        let weakened = match (site.name.starts_with("FENCE_"), order) {
            (true, Relaxed) => "none".into(),
            _ => format!("{order:?}"),
        };
        println!("| `{}` | {:?} | {weakened} | {verdict} |", site.name, site.order);
    }
    assert!(wrong.is_empty(), "unexpected: {wrong:#?}");
}

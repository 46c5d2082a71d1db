//! No atomic access without a site: only `sync.rs` names atomics, every access there takes its order
//! from a site, and every site is used by the core and explained in PROTOCOL.md.

use dualframe_core_model::sync::site;
use std::fs;
use std::path::{Path, PathBuf};

fn core() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../core")
}

/// The core's files by name, without comments and tests.
fn sources() -> Vec<(String, String)> {
    let files = fs::read_dir(core().join("src")).expect("the core's source");
    let read = |entry: std::io::Result<fs::DirEntry>| {
        let path = entry.expect("an entry").path();
        assert_eq!(path.extension().and_then(|ending| ending.to_str()), Some("rs"), "{path:?}");
        let text = fs::read_to_string(&path).expect("text");
        let shipped =
            text.split("#[cfg(all(test, not(loom)))]\nmod tests").next().unwrap_or_default();
        let code = shipped.lines().map(|line| line.split("//").next().unwrap_or_default());
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        (name, code.collect::<Vec<_>>().join("\n"))
    };
    let mut all: Vec<_> = files.map(read).collect();
    all.retain(|(name, _)| !name.ends_with("_tests.rs"));
    all
}

/// What gives access to memory that threads share, other than by a site.
const WAYS_AROUND: &[&str] = &[
    "sync::atomic",
    "atomic::",
    "portable_atomic",
    "AtomicBool",
    "AtomicU8",
    "AtomicU16",
    "AtomicU32",
    "AtomicU64",
    "AtomicUsize",
    "AtomicPtr",
    "AtomicCell",
    "UnsafeCell",
    "volatile",
    "intrinsics",
    "asm!",
    "std::sync",
    "Ordering::",
];

/// The ways around that occur in `code`.
fn ways_around(code: &str) -> Vec<&'static str> {
    WAYS_AROUND.iter().copied().filter(|way| code.contains(way)).collect()
}

/// Calls that touch an atomic, of which `code` has one with an order that is no site's.
fn unnamed_accesses(code: &str) -> Vec<&str> {
    let access = |line: &&str| line.contains("self.0.") || line.contains("imp::fence(");
    // Two have their order from the line before.
    let named = |line: &str| {
        ["site.effective(Access::", "imp::fence(order)", "exchange(old, new, order, "]
            .iter()
            .any(|order| line.contains(order))
    };
    // A cell's lends are no atomic accesses; loom watches them.
    let cell = |line: &str| ["with", "get", "into_inner"].iter().any(|lend| line.contains(lend));
    code.lines().filter(access).filter(|line| !named(line) && !cell(line)).collect()
}

#[test]
fn no_file_but_sync_names_atomics() {
    let sources = sources();
    assert!(sources.len() > 20, "the core has more files than {}", sources.len());
    for (name, code) in sources.iter().filter(|(name, _)| name != "sync.rs") {
        let around = match name.as_str() {
            // It is handed orders, and makes no access; its memory is one thread's.
            "instrument.rs" => Vec::new(),
            // Its records are raw memory, whose segment headers are watched.
            "contacts.rs" => {
                ways_around(code).into_iter().filter(|&way| way != "UnsafeCell").collect()
            }
            _ => ways_around(code),
        };
        assert!(around.is_empty(), "{name}: {around:?}");
    }
}

#[test]
fn every_access_in_sync_has_a_site() {
    let (_, sync) = sources().into_iter().find(|(name, _)| name == "sync.rs").expect("sync.rs");
    assert!(sync.matches("site.effective(Access::").count() >= 7, "the accesses are elsewhere");
    assert_eq!(unnamed_accesses(&sync), Vec::<&str>::new());
}

#[test]
fn every_site_is_used_and_explained() {
    let sources = sources();
    let protocol = fs::read_to_string(core().join("PROTOCOL.md")).expect("PROTOCOL.md");
    // `RING_HEAD_*` stands for all that begin so.
    let groups: Vec<_> = protocol
        .split('`')
        .filter_map(|word| word.strip_suffix('*'))
        .filter(|word| word.ends_with('_'))
        .collect();
    let mut unexplained = Vec::new();
    for site in site::ALL {
        let used = format!("site::{}", site.name);
        let uses = sources.iter().filter(|(name, _)| name != "sync.rs");
        assert!(uses.clone().any(|(_, code)| code.contains(&used)), "{} is not used", site.name);
        let group = groups.iter().any(|group| site.name.starts_with(group));
        if !group && !protocol.contains(site.name) {
            unexplained.push(site.name);
        }
    }
    assert_eq!(unexplained, Vec::<&str>::new(), "PROTOCOL.md says nothing of these");
}

/// The checks above are able to fail.
#[test]
fn accesses_without_a_site_are_noticed() {
    assert_eq!(ways_around("use core::sync::atomic::AtomicU32;").len(), 3);
    assert_eq!(ways_around("flag.load(Ordering::Relaxed)"), ["Ordering::"]);
    assert_eq!(ways_around("use core::cell::UnsafeCell;"), ["UnsafeCell"]);
    assert_eq!(unnamed_accesses("self.0.load(Ordering::SeqCst)").len(), 1);
    assert_eq!(unnamed_accesses("imp::fence(Ordering::SeqCst);").len(), 1);
}

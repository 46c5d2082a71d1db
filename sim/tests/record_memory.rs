//! What recording and reading take of memory. Alone in this file: allocations are counted over all
//! threads.
#![forbid(unsafe_code)]

use std::alloc::System;
use std::sync::atomic::{AtomicUsize, Ordering};

use dualframe_sim::executor::{ExecutorKind, FrameRecord};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::Message;
use dualframe_sim::object::ObjectId;
use dualframe_sim::record::{Flaw, Header, Reader, Recorder};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::ParticleScene;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// What a reader takes beside a chunk: deflate's window, a header.
const BESIDE: usize = 1 << 18;

fn allocations() -> usize {
    let stats = ALLOCATOR.stats();
    stats.allocations + stats.reallocations
}

/// A session of so many frames in each of which a message comes from outside; the allocations of its
/// last frames but for those at the checkpoint.
fn session(frames: u64) -> (Vec<u8>, usize) {
    let spec = ParticleScene::new(20);
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() };
    let scene = spec.build().expect("a valid scene");
    let mut manager = VeManager::new(scene, settings).expect("valid settings");
    let mut recorder = Recorder::begin(Vec::with_capacity(1 << 20), &Header::of(&spec), &manager)
        .expect("a start");
    let mailbox = manager.mailbox();
    let (first, last) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let mut on_frame = |record: &FrameRecord| {
        mailbox.post(ObjectId(record.frame as u32 % 20), Message::Damping(0.03));
        // Between two checkpoints.
        if record.frame == frames - 58 {
            first.store(allocations(), Ordering::Relaxed);
        }
        last.store(allocations(), Ordering::Relaxed);
    };
    let mut renderer = NullRenderer::new();
    recorder.run(&mut manager, frames, &mut renderer, &mut on_frame).expect("it runs");
    let (file, _) = recorder.finish(&manager).expect("it is written");
    (file, last.into_inner() - first.into_inner())
}

/// All bytes that were ever allocated while a file was read, freed or not; and why it ended.
fn taken(file: &[u8]) -> (usize, Option<Flaw>) {
    let region = Region::new(ALLOCATOR);
    let flaw = match Reader::new(file) {
        Err(error) => Some(error.flaw),
        Ok(mut reader) => reader.find_map(Result::err).map(|error| error.flaw),
    };
    let change = region.change();
    let grown = usize::try_from(change.bytes_reallocated).unwrap_or_default();
    (change.bytes_allocated + grown, flaw)
}

#[test]
fn memory() {
    let (file, allocations) = session(600);
    assert_eq!(allocations, 0, "frames that are recorded allocate");

    let (bytes, flaw) = taken(&file);
    assert!(flaw.is_none() && bytes < BESIDE + 40 * file.len(), "{bytes} for {}", file.len());
    // Lengths, as stored and as unpacked, of the first chunk.
    for (stored, unpacked) in
        [(u32::MAX, 0), (1 << 24, 1 << 24), (1 << 24, u32::MAX), (1, 1 << 24), (0, 1 << 24)]
    {
        for packing in 0..3 {
            let mut file = file.clone();
            file[13] = packing;
            file[14..18].copy_from_slice(&u32::to_le_bytes(stored));
            file[18..22].copy_from_slice(&u32::to_le_bytes(unpacked));
            let (bytes, flaw) = taken(&file);
            assert!(flaw.is_some(), "{stored}, {unpacked}");
            assert!(bytes < BESIDE + 4 * file.len(), "{bytes} for {stored}, {unpacked}, {packing}");
        }
    }
}

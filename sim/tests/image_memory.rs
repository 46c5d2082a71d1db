//! What reading takes of memory: two bytes a voxel, and of spoilt files never more than their length
//! can account for. Alone in this file: allocations are counted over all threads.
#![cfg(feature = "image")]
#![forbid(unsafe_code)]

#[path = "image/files.rs"]
mod files;

use std::alloc::System;
use std::cell::Cell;

use dualframe_sim::image::Image;
use files::{Nifti, gzip, nrrd, nrrd_bytes};
use proptest::prelude::*;
use proptest::sample::Index;
use proptest::test_runner::TestRunner;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// What a reader takes beside the voxels: its buffers, gzip's window, a header.
const BESIDE: usize = 1 << 18;
/// The most bytes that one of gzip's can hold.
const MOST_PER_BYTE: usize = 1032;

/// All bytes that were ever allocated while a file was read, freed or not; and whether it was read.
fn taken(file: &[u8]) -> (usize, bool) {
    let region = Region::new(ALLOCATOR);
    let read = Image::read(file, file.len() as u64);
    let change = region.change();
    let grown = usize::try_from(change.bytes_reallocated).unwrap_or_default();
    (change.bytes_allocated + grown, read.is_ok())
}

/// What is done to a file.
#[derive(Clone, Debug)]
enum Change {
    Set(Index, u8),
    Flip(Index, u32),
    Cut(Index),
    Remove(Index, usize),
    Insert(Index, Vec<u8>),
    Repeat(Index, usize),
}

fn changes() -> impl Strategy<Value = Change> {
    let place = || any::<Index>();
    let bytes = prop::collection::vec(any::<u8>(), 1..9);
    prop_oneof![
        (place(), prop::sample::select(&[0, 1, 0x7f, 0x80, 0xff, b'0', b'9', b'-', b'\n'][..]))
            .prop_map(|(place, byte)| Change::Set(place, byte)),
        (place(), 0..8_u32).prop_map(|(place, bit)| Change::Flip(place, bit)),
        place().prop_map(Change::Cut),
        (place(), 1..9_usize).prop_map(|(place, count)| Change::Remove(place, count)),
        (place(), bytes).prop_map(|(place, bytes)| Change::Insert(place, bytes)),
        (place(), 1..40_usize).prop_map(|(place, count)| Change::Repeat(place, count)),
    ]
}

fn apply(file: &mut Vec<u8>, change: &Change) {
    if file.is_empty() {
        return;
    }
    let length = file.len();
    match change {
        Change::Set(place, byte) => file[place.index(length)] = *byte,
        Change::Flip(place, bit) => file[place.index(length)] ^= 1 << bit,
        Change::Cut(place) => file.truncate(place.index(length)),
        Change::Remove(place, count) => {
            let start = place.index(length);
            file.drain(start..length.min(start + count));
        }
        Change::Insert(place, bytes) => {
            let start = place.index(length);
            file.splice(start..start, bytes.iter().copied());
        }
        Change::Repeat(place, count) => {
            let start = place.index(length);
            let piece = file[start..length.min(start + count)].to_vec();
            file.splice(start..start, piece);
        }
    }
}

fn two_bytes_a_voxel() {
    const SIDE: usize = 128;
    let voxels = SIDE.pow(3);
    let side = SIDE as i16;
    let dim = [3, side, side, side, 1, 1, 1, 1];
    let mut file = Nifti { dim, datatype: 64, bitpix: 64, ..Nifti::small() };
    // Front to back, foot to head, right to left.
    file.srow = [[0.0, 0.0, -1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
    file.data = vec![0; 8 * voxels];
    for bytes in [file.bytes(), gzip(&file.bytes())] {
        let (taken, read) = taken(&bytes);
        assert!(read);
        assert!(taken <= 2 * voxels + BESIDE, "{taken} bytes for {voxels} voxels");
    }
}

/// The files of a few hundred bytes that are spoilt.
fn seeds() -> Vec<Vec<u8>> {
    let (little, mut big) = (Nifti::small(), Nifti { big: true, ..Nifti::small() });
    (big.sform_code, big.qform_code, big.datatype) = (0, 1, 512);
    big.extension = vec![0; 20];
    big.vox_offset = 368.0;
    vec![
        little.bytes(),
        big.bytes(),
        gzip(&little.bytes()),
        nrrd_bytes(&nrrd("raw"), &little.data),
        nrrd_bytes(&nrrd("gzip"), &gzip(&little.data)),
    ]
}

/// Spoils what is packed as well as the packing.
fn spoilt_files() {
    const CASES: u32 = 4_000;
    let seeds = seeds();
    for seed in &seeds {
        assert!(taken(seed).1, "a seed is not sound");
    }
    let cases = std::env::var("PROPTEST_CASES").map_or(CASES, |_| ProptestConfig::default().cases);
    let config = ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() };
    let changes = prop::collection::vec(changes(), 1..5);
    let (sound, refused) = (Cell::new(0), Cell::new(0));
    let cases = (prop::sample::select(seeds), any::<bool>(), changes);
    let tested = TestRunner::new(config).run(&cases, |(mut file, pack, changes)| {
        changes.iter().for_each(|change| apply(&mut file, change));
        let file = if pack { gzip(&file) } else { file };
        let (taken, read) = taken(&file);
        let most = 2 * MOST_PER_BYTE * file.len() + BESIDE;
        prop_assert!(taken <= most, "{taken} bytes for a file of {}", file.len());
        let count = if read { &sound } else { &refused };
        count.set(count.get() + 1);
        Ok(())
    });
    tested.expect("no spoilt file does harm");
    let (sound, refused) = (sound.get(), refused.get());
    assert!(sound > 0 && refused > sound, "{sound} were read, {refused} were not");
}

#[test]
fn memory_is_bounded() {
    two_bytes_a_voxel();
    spoilt_files();
}

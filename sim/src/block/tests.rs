//! Which objects of blocks overlap, and what their updates cost.

use proptest::collection::vec;
use proptest::prelude::*;

use super::*;
use crate::scene::ParticleScene;

/// What extents there are in a case.
#[derive(Clone, Copy, Debug)]
struct Kind {
    /// How far from the middle they may begin.
    spread: f32,
    /// 1 if some are like those of solitary objects, or walls', or without end; 0 if none.
    odd: u32,
}

fn any_kind() -> impl Strategy<Value = Kind> {
    (1.0..4.0_f32, 0..2_u32).prop_map(|(spread, odd)| Kind { spread, odd })
}

fn place(spread: f32) -> impl Strategy<Value = Vec3> {
    let component = move || -spread..spread;
    [component(), component(), component()].prop_map(Vec3::from_array)
}

fn any_box(Kind { spread, odd }: Kind) -> impl Strategy<Value = Bounds> {
    let somewhere = (place(spread), place(1.0))
        .prop_map(|(min, size)| Bounds { min, max: min + 0.5 * size.abs() });
    let without_end = Bounds { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
    let others = prop::sample::select(vec![Bounds::EMPTY, Bounds::ALL, without_end]);
    prop_oneof![8 => somewhere, 3 * odd => others]
}

/// A box, and for some a sphere somewhere.
fn any_extent(kind: Kind) -> impl Strategy<Value = Extent> {
    let radius = prop_oneof![0.0..1.0_f32, Just(f32::INFINITY)];
    (any_box(kind), place(kind.spread), radius).prop_map(|(bounds, center, radius)| Extent {
        center,
        radius,
        ..Extent::of_box(bounds)
    })
}

/// One extent, which is treated for itself, or fewer than `end`, or not many fewer.
fn extents(end: usize) -> impl Strategy<Value = Vec<Extent>> {
    any_kind().prop_flat_map(move |kind| {
        let any = move || any_extent(kind);
        prop_oneof![vec(any(), 1), vec(any(), 0..end), vec(any(), end * 9 / 10..end)]
    })
}

/// A block of which only the extents are looked at.
fn block(all: &[Extent]) -> Block {
    let mut block = Block::default();
    block.ids.extend((0..all.len() as u32).map(ObjectId));
    let Block { extents, .. } = &mut block;
    extents.resize(all.len());
    extents.arrange(|place| all[place].center);
    all.iter().enumerate().for_each(|(place, own)| extents.set(place, own));
    // Some go and come again, to wherever there is room.
    for (place, own) in all.iter().enumerate().take(all.len() / 8) {
        extents.swap_remove(place);
        extents.push(own);
    }
    block.enclose();
    block
}

#[test]
fn what_an_update_took_is_shared_out_by_substeps() {
    let scene = ParticleScene { most_substeps: 100, ..ParticleScene::new(20) };
    let objects = scene.build().expect("a valid scene").objects;
    let mut block = Block::new(objects.into_iter().take(21).collect());
    block.note_cost(Duration::from_millis(21));
    let (wall, bodies): (Vec<_>, Vec<_>) = block.objects().iter().partition(|o| o.is_fixed());
    assert!(wall.iter().map(|wall| wall.cost()).eq([1e-3]), "nothing is known of it");
    let total: f32 = bodies.iter().map(|body| body.cost()).sum();
    assert!((total - 20e-3).abs() < 1e-6, "{total}");
    let price = |body: &&Object| body.cost() / batch::weight(body).expect("a body");
    let prices: Vec<f32> = bodies.iter().map(price).collect();
    assert!(prices.iter().all(|price| (price / prices[0] - 1.0).abs() < 1e-3), "{prices:?}");
    let costs: Vec<f32> = bodies.iter().map(|body| body.cost()).collect();
    assert!(costs[0] > 3.0 * costs[19], "{costs:?}");
}

#[test]
fn who_moved_is_beside_others_after_blocks_are_formed_anew() {
    let scene = ParticleScene::new(64).build().expect("a valid scene");
    let mut block = Block::new(scene.objects.into_iter().take(64).collect());
    // In a row, but anywhere in it: 37 and 64 have no common divisor.
    let row = |id: u32| id * 37 % 64;
    for object in &mut block.objects {
        let to = Vec3::Y * row(object.id().0) as f32 - object.center();
        let mesh = object.geometry.as_mesh_mut().expect("a particle");
        for node in 0..mesh.positions.len() {
            mesh.positions.add(node, to);
        }
        object.refit();
    }
    let is_arranged = |block: &Block| {
        let rows = |places: &[u32]| -> Vec<u32> {
            places.iter().map(|&place| row(block.ids[place as usize].0) / 16).collect()
        };
        block
            .extents
            .places()
            .chunks(16)
            .all(|chunk| rows(chunk).windows(2).all(|two| two[0] == two[1]))
    };
    block.refresh();
    assert!(!is_arranged(&block));
    block.fit();
    block.refresh();
    assert!(is_arranged(&block));
}

proptest! {
    #[test]
    fn every_overlap_is_found_once(few in extents(20), many in extents(300)) {
        let (few, many) = (block(&few), block(&many));
        let list = |block: &Block| -> Vec<Extent> {
            (0..block.ids.len()).map(|place| block.extents.at(place)).collect()
        };
        let (some, all) = (list(&few), list(&many));
        let pairs = |one: usize, others: std::ops::Range<usize>| others.map(move |other| [one, other]);
        let between: Vec<[usize; 2]> = (0..some.len())
            .flat_map(|one| pairs(one, 0..all.len()))
            .filter(|&[one, other]| some[one].overlaps(&all[other]))
            .collect();
        let within: Vec<[usize; 2]> = (0..all.len())
            .flat_map(|one| pairs(one, one + 1..all.len()))
            .filter(|&[one, other]| all[one].overlaps(&all[other]))
            .collect();
        for simd in Simd::available() {
            let (mut found, mut found_within) = (Vec::new(), Vec::new());
            few.overlaps(simd, &many, &mut found);
            many.overlaps_within(simd, &mut found_within);
            // In no particular order.
            found_within.iter_mut().for_each(|pair| pair.sort_unstable());
            found.sort_unstable();
            found_within.sort_unstable();
            prop_assert_eq!(&found, &between);
            prop_assert_eq!(&found_within, &within);
            let around = many.extent();
            let reaches = some.iter().any(|own| own.overlaps(around));
            prop_assert_eq!(few.reaches(simd, around), reaches);
            for (index, one) in some.iter().enumerate() {
                let reaches = between.iter().any(|&[own, _]| own == index);
                prop_assert_eq!(many.reaches(simd, one), reaches);
            }
        }
    }
}

use std::fmt::Debug;
use std::time::Duration;

use glam::{Quat, Vec3};
use parry3d::math::Pose;
use parry3d::shape::SharedShape;
use proptest::prelude::*;

use super::*;
use crate::behavior::batch::Order;
use crate::behavior::{Fixed, Keyframe, Scripted};
use crate::geometry::{Geometry, Rigid};
use crate::message::Message;
use crate::object::{Group, ObjectId};
use crate::scene::ParticleScene;
use crate::simd::Simd;

/// Deals particles whose updates take so many microseconds, for two workers; for each home what its blocks' updates
/// take, and how many objects they have.
fn dealt(micros: &[u64], homes: u32, besides: u64) -> Vec<Vec<(u64, usize)>> {
    dealt_for(2, micros, homes, besides)
}

fn dealt_for(workers: usize, micros: &[u64], homes: u32, besides: u64) -> Vec<Vec<(u64, usize)>> {
    let scene = ParticleScene::new(micros.len()).build().expect("a valid scene");
    let mut objects = scene.objects;
    for (object, &micros) in objects.iter_mut().zip(micros) {
        object.note_cost(Duration::from_micros(micros));
    }
    let (mut blocking, mut blocks) =
        Blocking::new(objects, Grain::Spatial, workers).expect("a valid environment");
    blocking.deal(&mut blocks, homes, Duration::from_micros(besides).as_secs_f32());
    let mut given = vec![Vec::new(); homes as usize];
    for (index, block) in blocks.iter().enumerate().take(blocking.moving_blocks) {
        let cost = |object: &Object| (object.cost() * 1e6).round() as u64;
        let objects = block.objects();
        given[blocking.home(index) as usize].push((objects.iter().map(cost).sum(), objects.len()));
    }
    given
}

#[test]
fn objects_are_shared_out_by_fours_where_lanes_stay_empty_anyhow() {
    let shares = [64, 640, 1_000, 1_024, 2_816, 2_880].map(|objects| share(objects, 64));
    assert_eq!(shares, [1, HALF, HALF, FEW, FEW, HALF]);
}

/// What others ask of a block: where its objects are and what they cost, its box, and who may touch.
fn asked(block: &Block) -> impl PartialEq + Debug + use<> {
    let mut found = Vec::new();
    block.overlaps_within(Simd::detect(), &mut found);
    // In no particular order.
    found.iter_mut().for_each(|pair| pair.sort_unstable());
    found.sort_unstable();
    (block.places().collect::<Vec<_>>(), block.bounds(), found)
}

/// Particles of which many have moved since they were grouped, in blocks formed anew.
fn regrouped() -> Vec<Block> {
    let scene = ParticleScene::new(300).build().expect("a valid scene");
    let (mut blocking, mut blocks) =
        Blocking::new(scene.objects, Grain::Spatial, 2).expect("a valid environment");
    for block in &mut blocks {
        for object in &mut block.objects {
            let id = object.id().0;
            let shift = Vec3::new(id as f32 % 7.0, id as f32 % 5.0, id as f32 % 3.0) * 0.05;
            let Some(mesh) = object.geometry.as_mesh_mut() else { continue };
            for node in 0..mesh.positions.len() {
                let position = mesh.positions.get(node).expect("a node");
                mesh.positions.set(node, position + shift);
            }
            object.refit();
            object.note_cost(Duration::from_micros(u64::from(id % 97 + 1)));
        }
        block.refresh();
        block.list_costs();
    }
    blocking.deal(&mut blocks, 2, 0.0);
    blocks
}

#[test]
fn blocks_formed_anew_are_as_if_all_were_looked_at() {
    for mut block in regrouped() {
        let told = asked(&block);
        block.refresh();
        block.list_costs();
        assert_eq!(asked(&block), told);
    }
}

#[test]
fn who_came_is_put_in_order_and_found_where_it_was() {
    let (mut order, mut disordered) = (Vec::new(), 0);
    for mut block in regrouped() {
        let before: Vec<ObjectId> = block.ids().to_vec();
        block.put_in_order(&mut order);
        disordered += usize::from(!order.is_empty());
        for (object, seat) in block.objects().iter().zip(&order) {
            assert_eq!(object.id(), before[seat.before]);
        }
        assert!(block.objects().iter().map(Order::of).is_sorted());
        block.put_in_order(&mut order);
        assert!(order.is_empty(), "it is in order");
    }
    assert!(disordered > 2, "{disordered}");
}

#[test]
fn an_order_that_messages_change_is_looked_at_when_costs_are_noted() {
    let (mut order, mut blocks) = (Vec::new(), regrouped());
    let block = &mut blocks[0];
    block.put_in_order(&mut order);
    block.objects[3].process(&Message::Damping(0.0), 0);
    let is_in_order = |block: &Block| block.objects().iter().map(Order::of).is_sorted();
    assert!(!is_in_order(block));
    block.note_cost(Duration::from_micros(1));
    block.put_in_order(&mut order);
    assert!(is_in_order(block));
}

#[test]
fn a_block_that_comes_elsewhere_keeps_its_objects() {
    let scene = ParticleScene::new(1_000).build().expect("a valid scene");
    let (mut blocking, mut blocks) =
        Blocking::new(scene.objects, Grain::Spatial, 2).expect("a valid environment");
    let numbers = |blocks: &[Block]| -> Vec<Vec<ObjectId>> {
        blocks.iter().map(|block| block.ids().to_vec()).collect()
    };
    let before = numbers(&blocks);
    let moving = blocking.moving_blocks;
    for (index, block) in blocks.iter_mut().take(moving).enumerate() {
        // The later ones take longer.
        let took = Duration::from_micros(1 << index.min(20));
        block.objects.iter_mut().for_each(|object| object.note_cost(took));
        block.list_costs();
    }
    for _ in 0..2 {
        blocking.deal(&mut blocks, 1, 0.0);
        let mut after = numbers(&blocks);
        assert_ne!(after, before);
        after[..moving].reverse();
        assert_eq!(after, before);
        let mut order = Vec::new();
        for block in &mut blocks {
            block.put_in_order(&mut order);
            assert!(order.is_empty(), "somebody has moved");
        }
    }
}

fn cost(home: &[(u64, usize)]) -> u64 {
    home.iter().map(|(cost, _)| cost).sum()
}

#[test]
fn homes_take_equally_long_and_begin_with_the_longest() {
    let micros: Vec<u64> = (1..=30).map(|object| object * object % 97 + 1).collect();
    let longest = 97;
    // One by one for four workers.
    for (workers, homes, blocks) in [(2, 1, 2), (2, 2, 2), (4, 1, 30), (4, 2, 30), (4, 4, 30)] {
        let given = dealt_for(workers, &micros, homes, 0);
        let share = micros.iter().sum::<u64>() / u64::from(homes);
        for home in &given {
            let cost = cost(home);
            assert!(cost.abs_diff(share) <= longest, "{cost} of {share} µs, {homes} homes");
            let halves = home.windows(2).filter(|pair| pair[1].0 >= 2 * pair[0].0);
            assert_eq!(halves.count(), 0, "a long one after a short one: {home:?}");
        }
        assert_eq!(given.iter().map(Vec::len).sum::<usize>(), blocks);
    }
}

/// The number of blocks of so many particles, and of something else that follows a script.
fn blocks_of(particles: usize, grain: Grain, workers: usize, other: Option<Geometry>) -> usize {
    let scene = ParticleScene::new(particles).build().expect("a valid scene");
    let mut objects = scene.objects;
    objects.truncate(particles);
    let id = ObjectId(particles as u32);
    let here = Keyframe { frame: 0, position: Vec3::ZERO, rotation: Quat::IDENTITY };
    objects.extend(other.map(|geometry| {
        Object::new(id, Group(0), geometry, Scripted::new(vec![here]).expect("a valid script"))
    }));
    Blocking::new(objects, grain, workers).expect("a valid environment").1.len()
}

#[test]
fn few_are_grouped_only_to_be_advanced_side_by_side() {
    let spatial = |particles, workers, other| blocks_of(particles, Grain::Spatial, workers, other);
    for (workers, particles) in [(1, 10), (2, 20), (2, 30), (4, 47), (2, SINGLE_OBJECTS)] {
        assert_eq!(spatial(particles, workers, None), workers, "{particles}");
        let too_many = particles / FEWEST_TOGETHER + 1;
        assert_eq!(spatial(particles, too_many, None), particles);
        assert_eq!(blocks_of(particles, Grain::Pairwise, workers, None), particles);
    }
    let wall = Geometry::Rigid(Rigid::wall(Vec3::ZERO, Vec3::Y));
    assert_eq!(spatial(30, 2, Some(wall)), 2);
    let scene = ParticleScene::new(1).build().expect("a valid scene");
    let surface = || Some(scene.objects[0].geometry.clone());
    assert_eq!(spatial(30, 2, surface()), 31, "it may take as long as all others");
    assert_eq!(spatial(SINGLE_OBJECTS, 2, surface()), 2, "they are many");
}

/// For each of two homes what of particles with 1 to so many substeps it is dealt weighs, from the heaviest on; before
/// anything is known of what they take.
fn weights_of(particles: usize, most_substeps: u32) -> [Vec<f32>; 2] {
    let scene = ParticleScene { most_substeps, ..ParticleScene::new(particles) };
    let objects = scene.build().expect("a valid scene").objects;
    let (mut blocking, mut blocks) =
        Blocking::new(objects, Grain::Spatial, 2).expect("a valid environment");
    blocking.deal(&mut blocks, 2, 0.0);
    let mut weights = [const { Vec::new() }; 2];
    for (index, block) in blocks.iter().enumerate().take(blocking.moving_blocks) {
        let home = &mut weights[blocking.home(index) as usize];
        home.extend(block.objects().iter().filter_map(batch::weight));
    }
    for home in &mut weights {
        home.sort_unstable_by(|a, b| b.total_cmp(a));
    }
    weights.sort_unstable_by(|a, b| b[0].total_cmp(&a[0]));
    weights
}

#[test]
fn few_bodies_are_beside_those_of_like_substeps() {
    let (few, others) = ([20, 30, 48], [19, 49, 65]);
    let (by_weight, by_place) = if batch::has_long_registers() {
        (few.to_vec(), others.to_vec())
    } else {
        (Vec::new(), [few, others].concat())
    };
    for particles in by_weight {
        let [heavy, light] = weights_of(particles, 100);
        assert!(heavy.last() >= light.first(), "{heavy:?}, {light:?}");
        let [heavy, light] = [heavy, light].map(|home| home.iter().sum::<f32>());
        assert!((heavy - light).abs() < 52.0, "{heavy}, {light}: more than one body's");
    }
    for particles in by_place {
        let [some, others] = weights_of(particles, 100);
        assert!(some.last() < others.first(), "{particles} are by place: {some:?}, {others:?}");
    }
}

#[test]
fn bodies_of_equal_substeps_are_dealt_by_place() {
    let scene = ParticleScene { most_substeps: 1, ..ParticleScene::new(30) };
    let objects = scene.build().expect("a valid scene").objects;
    let (mut blocking, mut blocks) =
        Blocking::new(objects, Grain::Spatial, 2).expect("a valid environment");
    let numbers = |blocks: &[Block]| -> Vec<Vec<ObjectId>> {
        blocks.iter().map(|block| block.ids().to_vec()).collect()
    };
    let by_place = numbers(&blocks);
    blocking.deal(&mut blocks, 2, 0.0);
    assert_eq!(numbers(&blocks), by_place);
}

/// A field of stones in a room, and the blocks that it makes.
fn scenery(stones: usize, workers: usize) -> Vec<Vec<ObjectId>> {
    let wall = Rigid::wall(Vec3::ZERO, Vec3::Y);
    let stone = |index: usize| {
        let place = Vec3::new((index % 50) as f32, 0.0, (index / 50) as f32);
        let mut stone = wall.clone();
        (stone.shape, stone.pose) = (SharedShape::ball(0.2), Pose::from_translation(place));
        stone
    };
    let parts = std::iter::once(wall.clone()).chain((0..stones).map(stone)).enumerate();
    let object =
        |(id, part)| Object::new(ObjectId(id as u32), Group(0), Geometry::Rigid(part), Fixed);
    let grouped = Blocking::new(parts.map(object).collect(), Grain::Spatial, workers);
    let (_, blocks) = grouped.expect("numbered without gaps");
    blocks.iter().map(|block| block.objects().iter().map(Object::id).collect()).collect()
}

#[test]
fn much_scenery_is_grouped_by_place_and_walls_apart() {
    for (stones, blocks) in [(0, 1), (SINGLE_OBJECTS, 2), (2_500, 1 + 10)] {
        let grouped = scenery(stones, 2);
        assert_eq!(grouped.len(), blocks, "{stones}");
        assert_eq!(grouped.last(), Some(&vec![ObjectId(0)]), "{stones}");
        assert_eq!(grouped.iter().map(Vec::len).sum::<usize>(), stones + 1);
    }
    for block in scenery(2_500, 2) {
        let column = |id: &ObjectId| (id.0.max(1) - 1) % 50;
        let columns = block.iter().map(column);
        let (least, most) = (columns.clone().min(), columns.max());
        assert!(most.zip(least).is_some_and(|(most, least)| most - least < 30), "{block:?}");
    }
}

#[test]
fn who_does_something_else_too_is_given_less() {
    // As if those with great numbers were on a core of half the speed.
    let micros: Vec<u64> = (0..1_000).map(|object| if object < 500 { 1 } else { 2 }).collect();
    let total: u64 = micros.iter().sum();
    // Half of the objects that are dealt out at once, at each of two splits, and what one object takes.
    let nearly = 2 * (HALF as u64 / 2 + 1) * 2;
    for besides in [0, 100, 300] {
        for homes in [2, 3, 4] {
            let given = dealt(&micros, homes, besides);
            let share = (total + besides) / u64::from(homes);
            for (home, expected) in
                given.iter().zip([share - besides].into_iter().chain(std::iter::repeat(share)))
            {
                let cost = cost(home);
                assert!(cost.abs_diff(expected) <= nearly, "{cost}, not {expected} µs: {given:?}");
            }
        }
    }
}

#[test]
fn who_has_no_time_left_is_given_little() {
    let given = dealt(&[1; 300], 2, 1_000_000);
    assert_eq!(given.iter().map(Vec::len).collect::<Vec<_>>(), [1, 3]);
    // Half a block's even share, in eights.
    assert_eq!(cost(&given[0]), 40, "{given:?}");
}

/// Objects in a box with these sides, in metres, with these costs, in nanoseconds.
fn in_a_box(sides: Vec3, costs: &[u32]) -> Vec<Key> {
    let place = |id: usize| Vec3::new((id % 7) as f32, (id % 11) as f32, (id % 13) as f32);
    let unit = Vec3::new(6.0, 10.0, 12.0);
    let key = |(id, &cost): (usize, &u32)| {
        Key::new((ObjectId(id as u32), place(id) / unit * sides, (cost as f32 + 0.5) * 1e-9))
    };
    costs.iter().enumerate().map(key).collect()
}

#[test]
fn a_part_is_divided_as_last_time_while_that_is_nearly_best() {
    let mut division = Division::default();
    let mut axis = |x, y, z| division.find_axis(&in_a_box(Vec3::new(x, y, z), &[1; 1_001]));
    assert_eq!(axis(1.0, 1.2, 1.2), 0);
    assert_eq!(axis(1.0, 1.3, 1.2), 1);
    assert_eq!(axis(1.2, 1.0, 1.1), 1);
    assert_eq!(axis(1.0, 1.0, 1.3), 2);
    let mut blocks = |of, share| division.find_blocks(of, share);
    let shares = [0.46, 0.48, 0.49, 0.475, 0.46];
    assert_eq!(shares.map(|share| blocks(20, share)), [9, 9, 10, 10, 9]);
    assert_eq!([0.1, 0.9].map(|share| blocks(2, share)), [1, 1]);
}

/// Where part after part has the cheaper half, that of one block grows from split to split.
#[test]
fn no_block_outgrows_its_room_however_uneven_costs_are() {
    const OBJECTS: usize = 1_024;
    const HOMES: u32 = 16;
    let most = most_shares(OBJECTS, HALF, HOMES as usize);
    for cheap in (HALF..OBJECTS).step_by(HALF) {
        for cost in [0.1, 0.4, 0.8] {
            let key = |id: usize| {
                let cost = if id < cheap { cost } else { 1.0 };
                Key::new((ObjectId(id as u32), Vec3::X * id as f32, cost))
            };
            let mut keys: Vec<Key> = (0..OBJECTS).map(key).collect();
            let mut members: Vec<Members> = (0..HOMES).map(|_| Members::of(Vec::new())).collect();
            let mut divisions = [(); 2].map(|()| vec![Division::default(); HOMES as usize]);
            let [of_blocks, of_homes] = &mut divisions;
            let parts = Parts { members: &mut members, of_blocks, of_homes };
            split::among_homes(&mut keys, parts, 0..HOMES, HALF, most, 0.0);
            let sizes = members.iter().map(|members| members.ids.len());
            assert_eq!(sizes.clone().sum::<usize>(), OBJECTS);
            assert!(
                sizes.clone().all(|size| size <= most * HALF),
                "{cheap} at {cost}: {:?}",
                sizes.collect::<Vec<_>>()
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn a_part_costs_as_nearly_as_shares_can_what_is_wanted(
        costs in proptest::collection::vec(prop_oneof![1..100_u32, 1..100_000_u32], 1..300),
        share in 1..9_usize,
        part in 0.0..1.1,
    ) {
        let mut keys = in_a_box(Vec3::ONE, &costs);
        let total = costs.iter().copied().map(u64::from).sum::<u64>();
        let wanted = (part * total as f64) as u64;
        let shares = split::part_by_cost(&mut keys, 1, share, total, wanted);
        let ids = |keys: &[Key]| keys.iter().map(|key| key.id).collect::<Vec<_>>();
        let (low, high) = keys.split_at((shares * share).min(keys.len()));
        let [mut low, mut high] = [ids(low), ids(high)];
        let mut sorted: Vec<u32> = (0..costs.len() as u32).collect();
        sorted.sort_by_key(|id| (id % 11, *id));
        low.sort_by_key(|id| (id % 11, *id));
        high.sort_by_key(|id| (id % 11, *id));
        prop_assert_eq!([low, high].concat(), &sorted[..]);
        let cost = |shares: usize| -> u64 {
            sorted.iter().take(shares * share).map(|&id| u64::from(costs[id as usize])).sum()
        };
        let off = (0..=costs.len().div_ceil(share)).map(|shares| cost(shares).abs_diff(wanted));
        prop_assert_eq!(Some(cost(shares).abs_diff(wanted)), off.min());
    }

    #[test]
    fn all_are_dealt_out_to_blocks_of_like_size(
        micros in proptest::collection::vec(1..100_u64, 1..400),
        homes in 1..9_u32,
        besides in 0..20_000_u64,
    ) {
        let given = dealt(&micros, homes, besides);
        prop_assert_eq!(given.iter().map(|home| cost(home)).sum::<u64>(), micros.iter().sum());
        let sizes: Vec<usize> = given.iter().flatten().map(|&(_, objects)| objects).collect();
        let even = micros.len().div_ceil(sizes.len()).next_multiple_of(share(micros.len(), sizes.len()));
        prop_assert!(sizes.iter().all(|size| (1..=UNEVENNESS * even).contains(size)), "{:?}", given);
    }
}

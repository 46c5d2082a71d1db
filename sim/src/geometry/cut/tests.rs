//! Cuts of flat patches, whose triangles are all counter-clockwise as seen from above.

mod parting;

use glam::{Vec2, Vec3};
use proptest::prelude::*;

use super::surface::edge;
use super::{Birth, Blade, CutSurface, Sweep};
use crate::geometry::CutNode;

/// The length of an edge, in metres.
const EDGE: f32 = 5e-3;
const NODES: usize = 9;

/// A patch of equilateral triangles with `NODES` nodes a side, from (0, 0) to about (42, 35) mm.
fn patch() -> CutSurface {
    let place = |index: usize| {
        let (column, row) = (index % NODES, index / NODES);
        let x = column as f32 + 0.5 * (row % 2) as f32;
        Vec3::new(x, row as f32 * 0.866_025_4, 0.0) * EDGE
    };
    let node = |rest| CutNode { rest, position: rest, velocity: Vec3::ZERO };
    let mut triangles = Vec::new();
    for row in 0..NODES - 1 {
        for column in 0..NODES - 1 {
            let at = |c: usize, r: usize| ((row + r) * NODES + column + c) as u32;
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
            triangles.extend(if row % 2 == 0 {
                [[a, b, c], [b, d, c]]
            } else {
                [[a, b, d], [a, d, c]]
            });
        }
    }
    CutSurface {
        nodes: (0..NODES * NODES).map(|index| node(place(index))).collect(),
        triangles,
        slits: Vec::new(),
        births: Vec::new(),
        shortest: 0.1 * EDGE,
    }
}

/// A blade that stands upright through the patch at a point (mm).
fn blade([x, y]: [f32; 2]) -> Blade {
    let at = |z| Vec3::new(x * 1e-3, y * 1e-3, z);
    Blade { tip: at(-4e-3), heel: at(0.1) }
}

/// Cuts along a polyline (mm), a segment a frame.
fn cut(surface: &mut CutSurface, path: &[[f32; 2]]) -> Option<u32> {
    let mut front = None;
    for ends in path.windows(2) {
        front = surface.cut(Sweep { before: blade(ends[0]), now: blade(ends[1]) }, front);
    }
    front
}

/// The area of a triangle at rest, positive if it is counter-clockwise.
fn area(surface: &CutSurface, triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|node| surface.nodes[node as usize].rest.as_dvec3());
    0.5 * (b - a).cross(c - a).z
}

/// Checks that a surface is a proper one, with the area and the nodes of the patch it was cut from.
fn check(surface: &CutSurface) {
    let whole = patch();
    let total = |surface: &CutSurface| -> f64 {
        surface.triangles.iter().map(|&triangle| area(surface, triangle)).sum()
    };
    assert!((total(surface) / total(&whole) - 1.0).abs() < 1e-6, "the area has changed");
    for &triangle in &surface.triangles {
        let area = area(surface, triangle);
        assert!(area > 1e-5 * f64::from(EDGE * EDGE), "{triangle:?} has an area of {area} m²");
    }
    let mut sides: Vec<[u32; 2]> =
        surface.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    sides.sort_unstable();
    assert!(sides.windows(2).all(|two| two[0] != two[1]), "two triangles on one side of an edge");
    for [a, b] in sides {
        let length = (surface.nodes[a as usize].rest - surface.nodes[b as usize].rest).length();
        assert!(length >= 0.099 * EDGE, "the edge of {a} and {b} is {length} m long");
    }
    for (node, old) in surface.nodes.iter().zip(&whole.nodes) {
        assert_eq!(node, old, "an old node has changed");
    }
    assert_eq!(surface.nodes.len(), whole.nodes.len() + surface.births.len());
    for node in 0..surface.nodes.len() as u32 {
        assert_eq!(fans(surface, node), 1, "the fan of node {node}");
    }
    for &slit in &surface.slits {
        assert_eq!((edge(slit), surface.count(slit)), (slit, 2));
    }
}

/// How many sets of triangles that share edges there are around a node.
fn fans(surface: &CutSurface, node: u32) -> usize {
    let around: Vec<[u32; 3]> = surface.fan(node).map(|place| surface.triangles[place]).collect();
    components(&around, |a, b| a.iter().filter(|corner| b.contains(corner)).count() >= 2)
}

/// How many pieces there are.
fn pieces(surface: &CutSurface) -> usize {
    components(&surface.triangles, |a, b| a.iter().any(|corner| b.contains(corner)))
}

fn components(triangles: &[[u32; 3]], joined: impl Fn(&[u32; 3], &[u32; 3]) -> bool) -> usize {
    let mut left = triangles.to_vec();
    let mut count = 0;
    while let Some(first) = left.pop() {
        count += 1;
        let mut stack = vec![first];
        while let Some(here) = stack.pop() {
            let (near, far) = left.into_iter().partition::<Vec<_>, _>(|there| joined(&here, there));
            stack.extend(near);
            left = far;
        }
    }
    count
}

/// The copies, which are the new sides of a cut.
fn copies(surface: &CutSurface) -> Vec<u32> {
    let copy = |birth: &Birth| match *birth {
        Birth::Copy(node) => Some(node),
        _ => None,
    };
    surface.births.iter().filter_map(copy).collect()
}

#[test]
fn a_straight_cut_is_where_the_blade_was() {
    let mut surface = patch();
    let front = cut(&mut surface, &[[9.7, 11.3], [14.0, 13.3], [31.2, 21.3]]);
    check(&surface);
    assert_eq!(pieces(&surface), 1);
    let front = front.expect("the blade is still in the patch");
    assert_eq!(fans(&surface, front), 1);
    assert!(!copies(&surface).contains(&front), "the tip is not parted");
    assert!(!copies(&surface).is_empty());
    // All new nodes are where the blade was: on both of the path's segments.
    for (node, birth) in surface.nodes[NODES * NODES..].iter().zip(&surface.births) {
        if !matches!(birth, Birth::Copy(_)) {
            let [x, y, _] = node.rest.to_array();
            let off = |[ax, ay]: [f32; 2], [bx, by]: [f32; 2]| {
                let cross = (bx - ax) * (y * 1e3 - ay) - (by - ay) * (x * 1e3 - ax);
                (cross / (bx - ax).hypot(by - ay)).abs()
            };
            let off = off([9.7, 11.3], [14.0, 13.3]).min(off([14.0, 13.3], [31.2, 21.3]));
            assert!(off < 1e-4, "a new node is {off} mm off the path");
        }
    }
}

#[test]
fn a_cut_in_many_frames_is_the_same_as_in_one() {
    let line = |frames: u16| -> Vec<[f32; 2]> {
        let at = |frame| f32::from(frame) / f32::from(frames);
        (0..=frames).map(|frame| [9.7 + 25.0 * at(frame), 11.3 + 10.0 * at(frame)]).collect()
    };
    let (mut once, mut often) = (patch(), patch());
    cut(&mut once, &line(1));
    cut(&mut often, &line(97));
    check(&often);
    assert_eq!(copies(&once).len(), copies(&often).len());
    assert_eq!(once.nodes.len(), often.nodes.len());
    for node in &once.nodes {
        let near = |other: &CutNode| (other.rest - node.rest).length() < 1e-6;
        assert!(often.nodes.iter().any(near), "no node at {}", node.rest);
    }
}

#[test]
fn a_cut_goes_on_from_its_front_where_tissue_has_moved() {
    // Within the triangles around the front, and beyond them on either side, ahead and behind.
    for moved in [[0.6, -1.2], [2.0, -9.0], [-3.0, 8.0], [6.0, 0.5], [-8.0, -2.0]] {
        let mut surface = patch();
        let front = cut(&mut surface, &[[10.0, 11.3], [20.0, 16.0]]).expect("it is in the patch");
        let parted = copies(&surface).len();
        for node in &mut surface.nodes {
            node.position += Vec3::new(moved[0], moved[1], 0.0) * 1e-3;
        }
        let sweep = Sweep { before: blade([20.0, 16.0]), now: blade([31.0, 21.0]) };
        let next = surface.cut(sweep, Some(front)).expect("it still is");
        assert!(copies(&surface).contains(&front), "{moved:?}: the old front is not parted");
        assert!(copies(&surface).len() > parted + 1, "{moved:?}: it went on by one edge at most");
        let off = surface.nodes[next as usize].position.truncate() - Vec2::new(0.031, 0.021);
        assert!(off.length() < 1.2 * EDGE, "{moved:?}: the new front is {off} m from the blade");
        assert!(!copies(&surface).contains(&next), "{moved:?}: the tip is parted");
        assert_eq!(pieces(&surface), 1, "{moved:?}");
        for node in &mut surface.nodes[..NODES * NODES] {
            node.position = node.rest;
        }
        check(&surface);
    }
}

#[test]
fn a_curved_cut_follows_the_curve() {
    let mut surface = patch();
    // By the half-angle's tangent, so that no library's sine decides.
    let arc: Vec<[f32; 2]> = (0..=60)
        .map(|step: u16| {
            let t = -1.0 + f32::from(step) / 30.0;
            let (sine, cosine) = (2.0 * t / (1.0 + t * t), (1.0 - t * t) / (1.0 + t * t));
            [20.3 + 11.0 * sine, 10.1 + 11.0 * cosine]
        })
        .collect();
    cut(&mut surface, &arc);
    check(&surface);
    let mut crossings = 0;
    // The first is the cut's start, which has been moved to the side that it was near.
    for (node, birth) in surface.nodes[NODES * NODES..].iter().zip(&surface.births).skip(1) {
        if matches!(birth, Birth::Between(..)) {
            let [x, y, _] = (node.rest * 1e3).to_array();
            let off = ((x - 20.3).hypot(y - 10.1) - 11.0).abs();
            assert!(off < 0.01, "a new node is {off} mm off the circle");
            crossings += 1;
        }
    }
    assert!(crossings > 8, "{crossings} crossings");
}

#[test]
fn what_the_blade_does_not_reach_is_not_cut() {
    let mut surface = patch();
    let above = |x: f32| Blade { tip: Vec3::new(x, 0.016, 1e-3), heel: Vec3::new(x, 0.016, 0.1) };
    assert_eq!(surface.cut(Sweep { before: above(-0.1), now: above(0.1) }, None), None);
    assert_eq!(surface, patch());
    // A stab alone does not cut either.
    let stab = Sweep { before: above(0.02), now: blade([20.0, 16.0]) };
    assert_eq!(surface.cut(stab, None), None);
    assert_eq!(surface, patch());
    // A blade that is lifted on its way cuts until then.
    let lifted = Sweep { before: blade([10.2, 16.3]), now: above(0.03) };
    assert_eq!(surface.cut(lifted, None), None);
    check(&surface);
    assert!(!copies(&surface).is_empty());
    assert!(surface.births.len() < 20);
}

/// A point in or near the patch, in mm.
fn point() -> impl Strategy<Value = [f32; 2]> {
    [-5.0_f32..48.0, -5.0_f32..40.0]
}

/// Cuts along polylines with so many frames a segment.
fn cuts() -> impl Strategy<Value = Vec<(Vec<[f32; 2]>, u8)>> {
    prop::collection::vec((prop::collection::vec(point(), 2..6), 1_u8..12), 1..4)
}

fn cut_all(
    surface: &mut CutSurface,
    cuts: &[(Vec<[f32; 2]>, u8)],
    mut after: impl FnMut(&CutSurface),
) {
    for (corners, frames) in cuts {
        let mut front = None;
        for ends in corners.windows(2) {
            let at = |frame: u8| {
                let share = f32::from(frame) / f32::from(*frames);
                blade([0, 1].map(|axis| ends[0][axis] + (ends[1][axis] - ends[0][axis]) * share))
            };
            for frame in 0..*frames {
                front = surface.cut(Sweep { before: at(frame), now: at(frame + 1) }, front);
                after(surface);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn any_cuts_leave_a_proper_surface(cuts in cuts()) {
        let (mut surface, mut again) = (patch(), patch());
        cut_all(&mut surface, &cuts, check);
        cut_all(&mut again, &cuts, |_| {});
        prop_assert_eq!(surface, again);
    }

    #[test]
    fn a_full_cut_leaves_no_way_across(
        left in 4.0_f32..31.0,
        right in 4.0_f32..31.0,
        frames in 1_u8..60,
    ) {
        let mut surface = patch();
        let (from, to) = ([-6.0, left], [50.0, right]);
        cut_all(&mut surface, &[(vec![from, to], frames)], |_| {});
        check(&surface);
        prop_assert_eq!(pieces(&surface), 2);
        // Nodes clearly on one side of the blade's path are joined to none clearly on the other.
        let side = |node: &u32| {
            let [x, y, _] = (surface.nodes[*node as usize].rest * 1e3).to_array();
            let height = y - (left + (right - left) * (x + 6.0) / 56.0);
            if height.abs() < 2.0 { 0.0 } else { height.signum() }
        };
        for triangle in &surface.triangles {
            let sides = triangle.each_ref().map(side);
            prop_assert!(!(sides.contains(&1.0) && sides.contains(&-1.0)), "{:?}", triangle);
        }
    }
}

/// A blade that rests where it is cuts nothing; its cut goes on from there as long as it is in the surface.
#[test]
fn a_blade_at_rest_that_is_taken_out_has_ended_its_cut() {
    let mut surface = patch();
    let front = cut(&mut surface, &[[10.0, 10.0], [20.0, 11.0]]);
    let node = front.expect("it ends in the patch");
    let whole = surface.clone();
    let at = surface.nodes[node as usize].position;
    let inside = blade([at.x * 1e3, at.y * 1e3]);
    assert_eq!(surface.cut(Sweep { before: inside, now: inside }, front), front);
    let up = |end: Vec3| end + Vec3::Z * 0.01;
    let above = Blade { tip: up(inside.tip), heel: up(inside.heel) };
    assert_eq!(surface.cut(Sweep { before: above, now: above }, front), None);
    assert_eq!(surface, whole);
}

/// What lies in folds is cut where the blade enters, near its heel, and after that where the cut goes on.
#[test]
fn a_cut_begins_in_the_fold_next_to_the_heel() {
    let corners = |z: f32| [[-1.0, -1.0, z], [2.0, -1.0, z], [-1.0, 2.0, z]].map(Vec3::from_array);
    let node = |rest| CutNode { rest, position: rest, velocity: Vec3::ZERO };
    let nodes = [0.0, 1.0, 2.0].into_iter().flat_map(corners).map(node).collect();
    let triangles = vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]];
    let surface =
        CutSurface { nodes, triangles, slits: Vec::new(), births: Vec::new(), shortest: 0.1 };
    let blade = Blade { tip: Vec3::NEG_Z, heel: Vec3::Z * 3.0 };
    let hit = |near: Option<Vec3>| {
        surface.hit(&blade, near.map(|near| near.as_dvec3())).map(|hit| hit.triangle)
    };
    assert_eq!(hit(None), Some(2));
    assert_eq!([0.2, 0.9, 1.7].map(|z| hit(Some(Vec3::Z * z))), [Some(0), Some(1), Some(2)]);
}

#[test]
fn a_slit_that_gets_a_node_is_two() {
    let mut surface = patch();
    surface.slit([40, 41]);
    let new = surface.node_on([41, 40], 0.5);
    assert_eq!(surface.nodes.len(), NODES * NODES + 1);
    let mut slits = surface.slits.clone();
    slits.sort_unstable();
    assert_eq!(slits, [[40, new], [41, new]]);
}

//! Cuts that part a surface, or go on where others have.

use super::*;

#[test]
fn a_cut_from_border_to_border_separates() {
    for frames in [1, 7, 50] {
        let mut surface = patch();
        let at = |frame: u16| f32::from(frame) / f32::from(frames);
        let path: Vec<[f32; 2]> =
            (0..=frames).map(|frame| [-3.0 + 50.0 * at(frame), 16.0 + 3.1 * at(frame)]).collect();
        assert_eq!(cut(&mut surface, &path), None, "the blade has left");
        check(&surface);
        assert_eq!(pieces(&surface), 2, "in {frames} frames");
        assert_eq!(surface.slits, [] as [[u32; 2]; 0]);
    }
}

#[test]
fn a_cut_along_edges_makes_only_copies() {
    let mut surface = patch();
    let height = 4.0 * 0.866_025_4 * 5.0;
    cut(&mut surface, &[[-3.0, height], [20.0, height], [60.0, height]]);
    check(&surface);
    assert_eq!(copies(&surface).len(), surface.births.len(), "no edge is crossed");
    assert_eq!(surface.births.len(), NODES);
    assert_eq!(pieces(&surface), 2);
}

#[test]
fn a_cut_goes_on_where_cuts_have_crossed() {
    let mut surface = patch();
    cut(&mut surface, &[[-3.0, 15.2], [50.0, 18.7]]);
    cut(&mut surface, &[[18.3, -3.0], [23.1, 50.0]]);
    assert_eq!(pieces(&surface), 4);
    // Through where they crossed: two of the four are parted.
    cut(&mut surface, &[[-3.0, -6.32], [46.0, 42.68]]);
    check(&surface);
    assert_eq!(pieces(&surface), 6);
}

#[test]
fn a_leaning_blade_clips_a_corner_as_an_upright_one_does() {
    let clip = |lean: [f32; 2]| {
        let blade = |[x, y]: [f32; 2]| {
            let at = |z: f32| Vec3::new(x * 1e-3 + lean[0] * z, y * 1e-3 + lean[1] * z, z);
            Blade { tip: at(-4e-3), heel: at(0.1) }
        };
        let mut surface = patch();
        let sweep = Sweep { before: blade([-3.0, 4.0]), now: blade([6.0, -3.0]) };
        assert_eq!(surface.cut(sweep, None), None, "the blade has left");
        check(&surface);
        assert_eq!(pieces(&surface), 2, "leaning by {lean:?}");
        surface
    };
    let upright = clip([0.0, 0.0]);
    for lean in [[0.3, 0.0], [0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5], [0.3, -0.2]] {
        let leaning = clip(lean);
        assert_eq!(leaning.triangles, upright.triangles, "leaning by {lean:?}");
        let places = leaning.nodes.iter().zip(&upright.nodes);
        assert!(places.clone().all(|(a, b)| a.rest.distance(b.rest) < 1e-6), "by {lean:?}");
    }
}

#[test]
fn a_cut_through_nodes_splits_no_edge_there() {
    let mut surface = patch();
    // Straight up through a node of every second row and across the edges between.
    cut(&mut surface, &[[20.0, -3.0], [20.0, 60.0]]);
    check(&surface);
    assert_eq!(pieces(&surface), 2);
    let crossed = surface.births.iter().filter(|birth| matches!(birth, Birth::Between(..)));
    assert_eq!(crossed.count(), NODES / 2);
    assert_eq!(copies(&surface).len(), NODES);
}

#[test]
fn cuts_may_cross() {
    let mut surface = patch();
    cut(&mut surface, &[[-3.0, 15.2], [50.0, 18.7]]);
    assert_eq!(pieces(&surface), 2);
    cut(&mut surface, &[[18.3, -3.0], [23.1, 50.0]]);
    check(&surface);
    assert_eq!(pieces(&surface), 4);
    // Within the patch: a cross leaves it in one piece, with four corners where the cuts meet.
    let mut surface = patch();
    cut(&mut surface, &[[9.0, 15.2], [33.0, 18.7]]);
    cut(&mut surface, &[[18.3, 6.0], [22.1, 30.0]]);
    check(&surface);
    assert_eq!(pieces(&surface), 1);
}

#[test]
fn a_closed_cut_frees_a_piece() {
    let mut surface = patch();
    let square = [[10.2, 8.1], [30.3, 8.4], [30.9, 26.2], [9.9, 25.8]];
    cut(&mut surface, &[square[0], square[1], square[2], square[3], square[0], square[1]]);
    check(&surface);
    assert_eq!(pieces(&surface), 2);
}

/// Two patches that share a node: an edge that is cut from there goes with its own patch.
#[test]
fn a_pinched_node_takes_its_slit_along() {
    let mut surface = patch();
    let (all, middle) = (surface.nodes.len() as u32, surface.nodes.len() as u32 / 2);
    let other = |node: u32| if node == middle { middle } else { node + all };
    let second: Vec<[u32; 3]> =
        surface.triangles.iter().map(|triangle| triangle.map(other)).collect();
    surface.nodes.extend_from_within(..);
    surface.triangles.extend(second);
    surface.slit([middle, other(middle + 1)]);
    surface.separate();
    assert_eq!(surface.births, [Birth::Copy(middle)]);
    assert_eq!(surface.slits, [[other(middle + 1), 2 * all]]);
    assert!(
        surface.fan(middle).all(|place| surface.triangles[place].iter().all(|&node| node < all))
    );
}

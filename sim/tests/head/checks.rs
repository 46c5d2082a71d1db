//! What holds of every head.

use std::collections::BTreeMap;

use dualframe_sim::geometry::edges;
use dualframe_sim::scene::head::{Entry, Form, Head, Hold, Layer, Structure};
use glam::Vec3;

/// Checks structures, attachments and plan.
pub(crate) fn check(head: &Head) {
    assert_eq!(head.structures.len(), Head::STRUCTURES);
    let mut names: Vec<&str> = head.structures.iter().map(|structure| structure.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), Head::STRUCTURES, "names are distinct");
    let nodes: usize = head.structures.iter().map(|structure| structure.positions.len()).sum();
    assert!((6_000..14_000).contains(&nodes), "{nodes} nodes");
    head.structures.iter().for_each(check_structure);
    check_attachments(head);
    check_plan(head);
}

fn check_structure(structure: &Structure) {
    let Structure { name, form, positions, triangles, pins, area_density, .. } = structure;
    let count = positions.len();
    assert!((40..1_800).contains(&count), "{name}: {count} nodes");
    assert!(positions.iter().all(|position| position.is_finite()), "{name}");
    check_manifold(name, triangles, count, *form != Form::Sheet);
    check_outside(structure);
    for &triangle in triangles {
        let area = 0.5 * normal(positions, triangle).length();
        assert!(area > 1e-9, "{name}: a triangle of {area} m²");
    }
    let lengths = edges(triangles)
        .into_iter()
        .map(|[a, b]| positions[a as usize].distance(positions[b as usize]));
    let longest = lengths.fold(0.0, f32::max);
    assert!(longest < 0.025, "{name}: an edge of {longest} m");
    assert!((0.05..50.0).contains(area_density), "{name}: {area_density} kg/m²");
    assert!(structure.stiffness > 0.0 && structure.stiffness < 1e5, "{name}");
    assert!(pins.is_sorted_by(|(a, _), (b, _)| a < b), "{name}");
    assert!(pins.iter().all(|&(node, _)| (node as usize) < count), "{name}");
    assert!(pins.len() >= 3, "{name}: nothing holds it");
    if *form == Form::Sheet && matches!(structure.layer, Layer::Scalp | Layer::Periosteum) {
        let loose = pins.iter().filter(|(_, hold)| *hold == Hold::Loose).count();
        assert!(2 * loose > count, "{name}: {loose} of {count} nodes lie on loose tissue");
    }
}

/// Every side has one triangle on each of its sides at most, and each node one fan of triangles around it:
/// in a closed surface a whole one.
fn check_manifold(name: &str, triangles: &[[u32; 3]], nodes: usize, closed: bool) {
    let mut next: Vec<BTreeMap<u32, u32>> = vec![BTreeMap::new(); nodes];
    for &[a, b, c] in triangles {
        for [node, from, to] in [[a, b, c], [b, c, a], [c, a, b]] {
            let twice = next[node as usize].insert(from, to);
            assert_eq!(twice, None, "{name}: two triangles on one side of {node} to {from}");
        }
    }
    for (node, next) in next.iter().enumerate() {
        let open: Vec<u32> =
            next.keys().copied().filter(|from| !next.values().any(|to| to == from)).collect();
        assert!(open.len() <= usize::from(!closed), "{name}: node {node} is pinched or open");
        let start = open.first().or(next.keys().next());
        let start = *start.unwrap_or_else(|| panic!("{name}: node {node} is in no triangle"));
        let (mut at, mut fan) = (start, 0);
        while let Some(&to) = next.get(&at) {
            (at, fan) = (to, fan + 1);
            if at == start {
                break;
            }
        }
        assert_eq!(fan, next.len(), "{name}: node {node} has more than one fan");
    }
}

fn normal(positions: &[Vec3], triangle: [u32; 3]) -> Vec3 {
    let [a, b, c] = triangle.map(|node| positions[node as usize]);
    (b - a).cross(c - a)
}

fn check_outside(structure: &Structure) {
    let Structure { name, positions, triangles, .. } = structure;
    if structure.form != Form::Sheet {
        let cone = |&t: &[u32; 3]| normal(positions, t).dot(positions[t[0] as usize]) / 6.0;
        let volume: f32 = triangles.iter().map(cone).sum();
        assert!(volume > 0.0, "{name}: inside out");
        return;
    }
    for &triangle in triangles {
        let normal = normal(positions, triangle);
        let out = match *name {
            "falx" => Vec3::Y,
            "tentorium" => Vec3::Z,
            _ => positions[triangle[0] as usize],
        };
        assert!(normal.dot(out) > 0.0, "{name}: a triangle is inside out");
    }
}

fn check_attachments(head: &Head) {
    let mut attached = vec![false; Head::STRUCTURES];
    for attachment in &head.attachments {
        let [a, b] = attachment.structures;
        assert!(a < b);
        attached[a] = true;
        attached[b] = true;
        let [first, second] = [a, b].map(|structure| &head.structures[structure]);
        let names = [first.name, second.name];
        assert!(attachment.stiffness > 0.0 && !attachment.links.is_empty());
        for side in 0..2 {
            let mut nodes: Vec<u32> = attachment.links.iter().map(|link| link[side]).collect();
            nodes.sort_unstable();
            assert!(nodes.is_sorted_by(|a, b| a < b), "{names:?}: a node in two links");
        }
        for &[a, b] in &attachment.links {
            let apart = first.positions[a as usize].distance(second.positions[b as usize]);
            assert!(apart <= 0.012, "{names:?}: {apart} m apart");
        }
    }
    for (structure, attached) in head.structures.iter().zip(attached) {
        assert!(attached, "{} stands alone", structure.name);
    }
    assert!(head.attachments.is_sorted_by(|a, b| a.structures < b.structures));
}

fn check_plan(head: &Head) {
    let plan = &head.plan;
    let length: f32 = plan.incision.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    assert!((0.085..0.095).contains(&length), "an incision of {length} m");
    assert_eq!(plan.incision.len(), plan.incision_normals.len());
    let scalp = &head.structures[0];
    let from_scalp = |point: Vec3| {
        let apart = scalp.positions.iter().map(|position| position.distance(point));
        apart.fold(f32::MAX, f32::min)
    };
    for (&point, normal) in plan.incision.iter().zip(&plan.incision_normals) {
        assert!((point.length() - head.skin_at(point)).abs() < 3e-4, "not on the skin");
        assert!(from_scalp(point) < 0.007, "not on the operative scalp");
        assert!(normal.dot(point.normalize()) > 0.8 && (normal.length() - 1.0).abs() < 1e-4);
    }
    assert_eq!((plan.flap.len(), plan.margin.len()), (3, 2));
    for pull in plan.flap.iter().chain(&plan.margin) {
        assert!(from_scalp(pull.from) < 0.007);
        let moved = pull.to - pull.from;
        assert!((0.008..0.05).contains(&moved.length()), "{moved}");
        assert!(pull.to.length() > head.skin_at(pull.to) - 1e-4, "drawn into the head");
    }
    assert_eq!(plan.burr_hole, plan.craniotomy[0]);
    let points: Vec<Vec3> = plan.craniotomy.iter().map(|entry| entry.point).collect();
    let side = |index: usize| points[(index + 1) % points.len()] - points[index];
    assert!((0..points.len()).all(|index| side(index).length() < 0.003), "it has gaps");
    let around: f32 = (0..points.len()).map(|index| side(index).length()).sum();
    assert!((0.14..0.18).contains(&around), "{around} m around");
    let twice: Vec3 =
        (0..points.len()).map(|i| (points[i] - plan.middle.point).cross(side(i))).sum();
    let area = 0.5 * twice.dot(-plan.middle.inward);
    assert!((0.001_4..0.002_4).contains(&area), "{area} m²");
    plan.craniotomy.iter().chain([&plan.middle]).for_each(|entry| check_entry(head, entry));
}

fn check_entry(head: &Head, entry: &Entry) {
    let &Entry { point, inward, thickness } = entry;
    assert!((inward.length() - 1.0).abs() < 1e-4);
    assert!(inward.dot(point.normalize()) < -0.8);
    assert!((0.001..0.02).contains(&thickness), "{thickness} m thick");
    let at = |depth: f32| head.skull.density_at(point + inward * depth);
    assert!(at(-0.001) < 0.5 && at(0.000_3) > 0.5, "{} {} at {point}", at(-0.001), at(0.000_3));
    assert!(at(thickness - 0.000_3) > 0.5 && at(thickness + 0.000_5) < 0.5, "at {point}");
}

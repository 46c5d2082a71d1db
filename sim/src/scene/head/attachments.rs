//! What holds neighbours together.

use glam::Vec3;

use super::structures::Structure;

/// Springs between two structures that lie next to each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Attachment {
    /// The two structures' numbers, the lower one first.
    pub structures: [usize; 2],
    /// The nodes that a spring joins, one of each structure; no node is in two.
    pub links: Vec<[u32; 2]>,
    /// Each spring's stiffness, in newtons per metre. Its length at rest is the nodes' distance at rest.
    pub stiffness: f32,
}

/// Of what makes two structures neighbours: parts of their names, how far apart their nodes may be, in
/// metres, and the stiffness of a spring, in newtons per metre.
struct Kinship(&'static str, &'static str, f32, f32);

/// The stiffness of what is one tissue, cut into patches; usually 200 N/m.
const SAME: f32 = 200.0;
/// That of what is grown together; usually 50 N/m.
const GROWN: f32 = 50.0;
/// That of loose and spidery tissue; usually 5 N/m.
const LOOSE: f32 = 5.0;

const KINSHIPS: [Kinship; 16] = [
    Kinship("scalp", "scalp", 0.012, SAME),
    Kinship("right frontotemporoparietal scalp", "right temporalis", 0.012, LOOSE),
    Kinship("left scalp", "left temporalis", 0.012, LOOSE),
    Kinship("right frontotemporoparietal scalp", "right periosteum", 0.010, LOOSE),
    Kinship("right frontotemporoparietal scalp", "superficial temporal artery", 0.006, GROWN),
    Kinship("right temporalis", "right periosteum", 0.010, GROWN),
    Kinship("dura", "dura", 0.012, SAME),
    Kinship("dura", "falx", 0.012, SAME),
    Kinship("dura", "tentorium", 0.012, SAME),
    Kinship("falx", "tentorium", 0.012, SAME),
    Kinship("dura", "sagittal sinus", 0.009, SAME),
    Kinship("falx", "sagittal sinus", 0.009, SAME),
    Kinship("dura", "meningeal artery", 0.005, GROWN),
    Kinship("sagittal sinus", "bridging vein", 0.009, GROWN),
    Kinship("lobe", "bridging vein", 0.006, GROWN),
    Kinship("brainstem", "cerebellum", 0.012, GROWN),
];

/// Brain with what is around it: brain on its own, and spider's tissue on dura.
const BRAIN: [Kinship; 5] = [
    Kinship("lobe", "lobe", 0.006, GROWN),
    Kinship("dura", "lobe", 0.007, LOOSE),
    Kinship("tentorium", "lobe", 0.007, LOOSE),
    Kinship("tentorium", "cerebellum", 0.008, LOOSE),
    Kinship("lobe", "brainstem", 0.008, GROWN),
];

/// All attachments, in the order of their structures.
pub(super) fn attachments(structures: &[Structure]) -> Vec<Attachment> {
    let mut found = Vec::new();
    for (b, second) in structures.iter().enumerate() {
        for (a, first) in structures[..b].iter().enumerate() {
            let kin = KINSHIPS.iter().chain(&BRAIN).find(|Kinship(one, two, ..)| {
                let fits =
                    |one: &str, two: &str| first.name.contains(one) && second.name.contains(two);
                fits(one, two) || fits(two, one)
            });
            let Some(&Kinship(.., reach, stiffness)) = kin else { continue };
            let links = links(&first.positions, &second.positions, reach);
            if !links.is_empty() {
                found.push(Attachment { structures: [a, b], links, stiffness });
            }
        }
    }
    found.sort_by_key(|attachment| attachment.structures);
    found
}

/// Pairs of nodes no farther apart than `reach`, the nearest first, each node once; in the order of the
/// first structure's nodes.
fn links(first: &[Vec3], second: &[Vec3], reach: f32) -> Vec<[u32; 2]> {
    let near = |a: u32, position: &Vec3| {
        let apart = second.iter().map(move |other| position.distance_squared(*other)).zip(0..);
        let apart = apart.filter(|&(square, _)| square <= reach * reach);
        // Lengths that are not negative are in the order of their bits.
        apart.map(|(square, b)| (square.to_bits(), a, b)).collect::<Vec<_>>()
    };
    let mut pairs: Vec<(u32, u32, u32)> =
        (0..).zip(first).flat_map(|(a, position)| near(a, position)).collect();
    pairs.sort_unstable();
    let (mut of_first, mut of_second) = (vec![false; first.len()], vec![false; second.len()]);
    let mut links = Vec::new();
    for (_, a, b) in pairs {
        let taken = [&mut of_first[a as usize], &mut of_second[b as usize]];
        if taken.iter().all(|taken| !**taken) {
            taken.into_iter().for_each(|taken| *taken = true);
            links.push([a, b]);
        }
    }
    links.sort_unstable();
    links
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_node_once_and_the_nearest_first() {
        let at = |x: f32| Vec3::new(x, 0.0, 0.0);
        let (first, second) = ([at(0.0), at(1.0), at(9.0)], [at(1.1), at(0.8), at(-0.5)]);
        assert_eq!(links(&first, &second, 1.0), [[0, 2], [1, 0]]);
        assert_eq!(links(&first, &second, 0.2), [[1, 0]]);
    }
}

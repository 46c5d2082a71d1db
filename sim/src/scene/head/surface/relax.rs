//! Even triangles.

use glam::Vec3;

use super::{Surface, sides};

impl Surface {
    /// Moves each node towards the middle of its neighbours, `rounds` times by `shares` of the way in
    /// turn, and then to where `project` says; on a border only neighbours along it count, so that it
    /// becomes smooth.
    ///
    /// A positive share followed by a slightly greater negative one keeps a closed surface's volume
    /// (Taubin 1995).
    pub(in crate::scene::head) fn relaxed(
        mut self,
        rounds: usize,
        shares: &[f32],
        project: impl Fn(Vec3) -> Vec3,
    ) -> Self {
        let border = self.border();
        let on_border = self.on_border();
        let inner = self.triangles.iter().flat_map(|&triangle| sides(triangle));
        let inner = inner.filter(|&[a, _]| !on_border[a as usize]);
        let along = border.iter().flat_map(|&[a, b]| [[a, b], [b, a]]);
        let pulls: Vec<[u32; 2]> = inner.chain(along).collect();
        for &share in shares.iter().cycle().take(rounds * shares.len()) {
            let mut sums = vec![(Vec3::ZERO, 0.0); self.positions.len()];
            for &[node, neighbour] in &pulls {
                let (sum, count) = &mut sums[node as usize];
                *sum += self.positions[neighbour as usize];
                *count += 1.0;
            }
            for (position, (sum, count)) in self.positions.iter_mut().zip(sums) {
                if count > 0.0 {
                    *position = project(*position + (sum / count - *position) * share);
                }
            }
        }
        self
    }
}

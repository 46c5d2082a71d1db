//! Sheets: parts of a surface.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{Surface, sides};

impl Surface {
    /// The sheet of the triangles whose middles `keep` says are in it: the largest part of them, without
    /// triangles that hang on by one side only and without corners where it is pinched.
    pub(in crate::scene::head) fn sheet(mut self, keep: impl Fn(Vec3) -> bool) -> Self {
        let positions = &self.positions;
        self.triangles.retain(|triangle| {
            let [a, b, c] = triangle.map(|node| positions[node as usize]);
            keep((a + b + c) / 3.0)
        });
        loop {
            let before = self.triangles.len();
            self = self.largest_part().without_ears().without_pinches();
            if self.triangles.len() == before {
                return self;
            }
        }
    }

    /// Without triangles that have two sides or more on the border.
    fn without_ears(mut self) -> Self {
        let border = self.border();
        self.triangles.retain(|&triangle| {
            let open =
                sides(triangle).into_iter().filter(|side| border.binary_search(side).is_ok());
            open.count() < 2
        });
        self
    }

    /// Without the triangles around a node that are not connected, around it, to its first one.
    fn without_pinches(mut self) -> Self {
        let mut around: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (number, triangle) in self.triangles.iter().enumerate() {
            triangle.iter().for_each(|&node| around.entry(node).or_default().push(number));
        }
        let mut gone = vec![false; self.triangles.len()];
        for (&node, numbers) in &around {
            let others = |number: usize| {
                let triangle = self.triangles[number];
                triangle.into_iter().filter(move |&other| other != node)
            };
            let (mut fan, mut left) = (vec![numbers[0]], numbers[1..].to_vec());
            let mut next = 0;
            while let Some(&number) = fan.get(next) {
                let beside = |&other: &usize| others(other).any(|a| others(number).any(|b| a == b));
                fan.extend(left.iter().copied().filter(beside));
                left.retain(|other| !fan.contains(other));
                next += 1;
            }
            left.iter().for_each(|&number| gone[number] = true);
        }
        let mut gone = gone.into_iter();
        self.triangles.retain(|_| gone.next() == Some(false));
        self
    }
}

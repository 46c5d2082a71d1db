//! Parting the sides of a cut.

use super::surface::{CutSurface, edge};

impl CutSurface {
    /// Gives every node at an edge that is cut as many copies as its fan has components. The component
    /// with the first triangle keeps the node.
    pub(super) fn separate(&mut self) {
        let mut ends: Vec<u32> = self.slits.iter().flatten().copied().collect();
        ends.sort_unstable();
        ends.dedup();
        for node in ends {
            for component in self.components(node).into_iter().skip(1) {
                self.move_to_copy(node, &component);
            }
        }
        let slits = std::mem::take(&mut self.slits);
        self.slits = slits.into_iter().filter(|&slit| self.count(slit) == 2).collect();
    }

    /// The triangles around a node, in sets that edges join which are not cut.
    fn components(&self, node: u32) -> Vec<Vec<usize>> {
        let mut left: Vec<usize> = self.fan(node).collect();
        let mut components = Vec::new();
        while !left.is_empty() {
            let mut component = vec![left.remove(0)];
            let mut seen = 0;
            while seen < component.len() {
                let here = component[seen];
                seen += 1;
                let (joined, others) = left
                    .into_iter()
                    .partition::<Vec<_>, _>(|&there| self.joined(node, here, there));
                component.extend(joined);
                left = others;
            }
            components.push(component);
        }
        components
    }

    /// Whether two triangles around a node share an edge there that is not cut.
    fn joined(&self, node: u32, a: usize, b: usize) -> bool {
        let shared = |other: u32| {
            other != node
                && self.triangles[b].contains(&other)
                && !self.slits.contains(&edge([node, other]))
        };
        self.triangles[a].into_iter().any(shared)
    }

    fn move_to_copy(&mut self, node: u32, component: &[usize]) {
        let copy = self.copy(node);
        for &place in component {
            self.triangles[place] =
                self.triangles[place].map(|corner| if corner == node { copy } else { corner });
        }
        // An edge both of whose sides have moved is still cut and still shared.
        for place in 0..self.slits.len() {
            let [a, b] = self.slits[place];
            if a == node || b == node {
                let moved = [if a == node { b } else { a }, copy];
                if self.count(moved) == 2 {
                    self.slits[place] = edge(moved);
                }
            }
        }
    }
}

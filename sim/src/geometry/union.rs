//! Which runs of voxels hang together: union–find.
//!
//! As in L. He, Y. Chao, K. Suzuki, "A run-based two-scan labeling algorithm", IEEE Trans. Image Process.
//! 17 (2008) 749; ways to roots are halved as in R. E. Tarjan, J. van Leeuwen, "Worst-case analysis of set
//! union algorithms", J. ACM 31 (1984) 245, so that no image makes them long.

use std::ops::Range;

/// Each run knows one of lower number, up to a root, which knows itself: the first run of its part.
#[derive(Default)]
pub(crate) struct Union {
    parents: Vec<u32>,
}

impl Union {
    /// There are so many runs; the new ones each stand alone.
    pub(crate) fn grow(&mut self, runs: usize) {
        self.parents.extend(self.parents.len() as u32..runs as u32);
    }

    /// The first run of this one's part.
    pub(crate) fn root(&mut self, mut run: u32) -> u32 {
        while self.parents[run as usize] != run {
            let next = self.parents[self.parents[run as usize] as usize];
            self.parents[run as usize] = next;
            run = next;
        }
        run
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }

    /// Joins the runs of two neighbouring rows where they overlap; `xs` says where a run is.
    pub(crate) fn join_rows(
        &mut self,
        xs: impl Fn(usize) -> Range<u32>,
        own: Range<usize>,
        other: Range<usize>,
    ) {
        let (mut a, mut b) = (own.start, other.start);
        while a < own.end && b < other.end {
            let (one, two) = (xs(a), xs(b));
            if one.start < two.end && two.start < one.end {
                self.join(a as u32, b as u32);
            }
            if one.end < two.end { a += 1 } else { b += 1 }
        }
    }
}

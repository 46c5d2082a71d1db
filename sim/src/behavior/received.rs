//! What a block's objects are told of a frame's interactions, in the order in which they take it.

use crate::block::Block;
use crate::interaction::{ContactRecord, Segment};

/// This frame's contacts of a block's objects, left where interactions put them.
#[derive(Debug, Default)]
pub(crate) struct Received<'r> {
    /// As they came.
    arrived: Vec<Segment<'r>>,
    /// Object by object, each one's by the other objects' numbers.
    ordered: Vec<Segment<'r>>,
    /// For each object where among those its own end.
    ends: Vec<u32>,
}

impl<'r> Received<'r> {
    pub(super) fn reserve(&mut self, objects: usize, segments: usize) {
        self.arrived.reserve(segments);
        self.ordered.reserve(segments);
        self.ends.reserve(objects);
    }

    /// Takes in what concerns the objects of `block`, and nothing else.
    pub(crate) fn extend(
        &mut self,
        block: &Block,
        results: impl Iterator<Item = &'r [ContactRecord]>,
    ) {
        let Self { arrived, ordered, ends } = self;
        ends.resize(block.objects().len(), 0);
        for segment in results.flat_map(Segment::all) {
            if block.has_at(segment.place(), segment.object()) {
                ends[segment.place()] += 1;
                arrived.push(segment);
            }
        }
        // A counting sort by places: from numbers to starts, and from starts to ends.
        let mut start = 0;
        for end in ends.iter_mut() {
            start += std::mem::replace(end, start);
        }
        ordered.extend_from_slice(arrived);
        for &segment in &*arrived {
            let end = &mut ends[segment.place()];
            ordered[*end as usize] = segment;
            *end += 1;
        }
    }

    /// What the object at `place` is told, by the other objects' numbers.
    pub(crate) fn at(&mut self, place: usize) -> &[Segment<'r>] {
        let start = place.checked_sub(1).map_or(0, |before| self.ends[before]);
        let own = &mut self.ordered[start as usize..self.ends[place] as usize];
        // Few, and often in order.
        own.sort_unstable_by_key(|segment| segment.other());
        own
    }

    /// Forgets everything, keeps the memory.
    pub(crate) fn emptied<'n>(mut self) -> Received<'n> {
        self.ends.clear();
        Received { arrived: emptied(self.arrived), ordered: emptied(self.ordered), ends: self.ends }
    }
}

/// The memory of a list for what lives as long as is wanted: a list that is collected from one of what is
/// as large takes over its memory.
fn emptied<'n>(mut list: Vec<Segment<'_>>) -> Vec<Segment<'n>> {
    list.clear();
    list.into_iter().map(|_| unreachable!("the list is empty")).collect()
}

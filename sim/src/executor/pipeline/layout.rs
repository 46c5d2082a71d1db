//! Blocks for a number of workers, and what is made to their measure.

use dualframe_core::error::Table;
use dualframe_core::pipeline::MOST_HOMES;
use dualframe_core::storage::InteractionSlot;

use super::host::{Found, Register};
use super::memory::{Tables, modelled_interactions, spare_interactions};
use crate::behavior::Room;
use crate::block::Block;
use crate::blocking::{Blocking, Grain};
use crate::object::Object;
use crate::stages::Stages;

/// The blocks, and all that is as many, or as large, as they ask for.
pub(super) struct Layout {
    pub(super) blocks: Vec<Block>,
    pub(super) blocking: Blocking,
    pub(super) tables: Tables,
    pub(super) register: Register,
    pub(super) room: Room,
    pub(super) homes: u32,
    /// The number of workers that all this is for.
    workers: usize,
}

impl Layout {
    /// Of these objects, which can be grouped, for so many workers.
    pub(super) fn new(objects: Vec<Object>, stages: &Stages, grain: Grain, workers: usize) -> Self {
        let Formed { blocking, blocks, interactions, homes } =
            Formed::new(objects, stages, grain, workers);
        Self {
            tables: Tables::new(&blocks, interactions, homes as usize),
            register: Register::new(&blocks),
            room: Room::of(blocks.iter()),
            blocks,
            blocking,
            homes,
            workers,
        }
    }

    /// Forms more blocks and homes if there are more workers than they are for; fewer work on as many as there are.
    /// What tables have grown to for objects' contacts and letters they keep.
    pub(super) fn suit(&mut self, workers: usize, stages: &Stages, grain: Grain) {
        if workers > self.workers {
            let objects = self.blocks.drain(..).flat_map(|block| block.objects).collect();
            let Formed { blocking, blocks, interactions, homes } =
                Formed::new(objects, stages, grain, workers);
            self.tables.model(interactions, blocks.len(), homes as usize);
            (self.register, self.room) = (Register::new(&blocks), Room::of(blocks.iter()));
            (self.blocks, self.blocking) = (blocks, blocking);
            (self.homes, self.workers) = (homes, workers);
        }
    }

    /// Gives a table more room, for so much.
    pub(super) fn grow(&mut self, table: Table, needed: usize) {
        self.tables.grow(table, needed, self.blocks.len());
    }

    /// Models the interactions anew, of which rules have changed.
    pub(super) fn model(&mut self, stages: &Stages) {
        let interactions = modelled_interactions(stages, &self.blocks);
        self.tables.model(interactions, self.blocks.len(), self.homes as usize);
    }
}

/// Objects in blocks, dealt to homes, and which of the blocks may interact.
struct Formed {
    blocking: Blocking,
    blocks: Vec<Block>,
    interactions: Vec<InteractionSlot<Found>>,
    homes: u32,
}

impl Formed {
    fn new(objects: Vec<Object>, stages: &Stages, grain: Grain, workers: usize) -> Self {
        let homes = homes(workers);
        let (mut blocking, mut blocks) = Blocking::group(objects, grain, workers);
        let interactions = match grain {
            Grain::Spatial => {
                blocking.deal(&mut blocks, homes, 0.0);
                spare_interactions(&blocks)
            }
            Grain::Pairwise => modelled_interactions(stages, &blocks),
        };
        Self { blocking, blocks, interactions, homes }
    }
}

/// The homes of so many workers: one for each, or, where these would be too many, one for as many workers each.
fn homes(workers: usize) -> u32 {
    workers.div_ceil(workers.div_ceil(MOST_HOMES)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn homes_have_as_many_workers_each() {
        for workers in 1..=256 {
            let homes = homes(workers) as usize;
            assert!(homes <= MOST_HOMES && homes >= workers.min(MOST_HOMES / 2), "{workers}");
            let most = workers.div_ceil(homes);
            // All but the last ones: at most so many are short of one.
            assert!(most * homes - workers < most, "{workers} workers, {homes} homes");
        }
    }
}

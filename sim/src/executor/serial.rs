//! One thread, stage after stage.

use std::sync::Arc;

use super::clock::{Clock, Running, Stage, StageSeconds};
use super::world::{self, Candidates, Outbox, Outcome, World};
use super::{Executor, ExecutorError, FrameRecord, OnFrame, Refused};
use crate::behavior::{Room, Workspace};
use crate::block::Block;
use crate::blocking::Grain;
use crate::geometry::Bounds;
use crate::interaction::Scratch;
use crate::mailbox::Mailbox;
use crate::object::Object;
use crate::render::Renderer;
use crate::scene::Scene;
use crate::stages::{PairCount, Stages};
use crate::timeline::Timeline;

/// One thread, stage after stage: no locks, no queues, nothing of the pipeline.
pub struct SerialExecutor {
    world: World,
    bounds: Vec<Bounds>,
    found: Vec<u32>,
    candidates: Candidates,
    outcomes: Vec<Outcome>,
    outbox: Outbox,
    scratch: Scratch,
    workspace: Workspace,
    clock: Clock,
    running: Running,
    frame: u64,
}

impl SerialExecutor {
    /// Takes over a scene.
    ///
    /// # Errors
    /// Objects that cannot be grouped.
    pub fn new(scene: Scene, grain: Grain) -> Result<Self, Box<Refused>> {
        let (scene, ()) = Refused::unless(scene, grain, 1, || Ok(()))?;
        let frame = scene.frame;
        let world = World::new(scene, grain, 1);
        let blocks = world.blocks.len();
        Ok(Self {
            bounds: Vec::with_capacity(blocks),
            found: world::found_list(),
            candidates: Candidates::new(blocks),
            outcomes: world::first_outcomes(blocks, grain),
            outbox: world::outbox(blocks),
            scratch: Scratch::new(),
            workspace: Workspace::with_room(Room::of(world.blocks.iter())),
            clock: Clock::default(),
            running: Running::new(),
            frame,
            world,
        })
    }

    fn broad_phase(&mut self) {
        let _timer = self.clock.time(Stage::BroadPhase, self.frame);
        let World { stages, blocks, partners, .. } = &self.world;
        self.bounds.clear();
        self.bounds.extend(blocks.iter().map(Block::bounds));
        self.candidates.clear();
        for first in 0..blocks.len() {
            let block = |index: usize| &blocks[index];
            partners.find(first, stages, &self.bounds, block, &mut self.found);
            self.candidates.extend(first, &self.found);
        }
    }

    fn interact(&mut self) -> PairCount {
        let _timer = self.clock.time(Stage::Interaction, self.frame);
        let pairs = &self.candidates.pairs;
        if self.outcomes.len() < pairs.len() {
            self.outcomes.resize_with(pairs.len(), Outcome::default);
        }
        let mut count = PairCount::default();
        for (&pair, outcome) in pairs.iter().zip(&mut self.outcomes) {
            let (first, second) = world::pair(&self.world.blocks, pair);
            outcome.compute(&self.world.stages, first, second, &mut self.scratch);
            count += outcome.pairs;
        }
        count
    }

    fn update(&mut self) {
        let _timer = self.clock.time(Stage::Update, self.frame);
        let World { stages, blocks, mail, outside, .. } = &mut self.world;
        let from_outside = outside.due(self.frame);
        let letters = |object| mail.to(object).chain(from_outside.to(object));
        for (index, block) in blocks.iter_mut().enumerate() {
            let outcomes = self.candidates.of_block(index).map(|place| &self.outcomes[place]);
            let results = outcomes.map(Outcome::records);
            let mut post = |from, to, message| self.outbox.push((from, to, message));
            stages.update(self.frame, block, results, &mut self.workspace, letters, &mut post);
        }
        world::empty_into(&mut self.outbox, mail);
    }

    fn render(&mut self, renderer: &mut dyn Renderer) {
        let _timer = self.clock.time(Stage::Render, self.frame);
        for block in &self.world.blocks {
            self.world.stages.render(block, renderer);
        }
        renderer.swap(self.frame);
    }
}

impl Executor for SerialExecutor {
    fn advance(
        &mut self,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        self.running.begin();
        self.world.outside.begin(self.frame);
        for _ in 0..frames {
            if self.world.regroups_before(self.frame) {
                self.world.regroup(false);
            }
            self.world.mail.turn();
            self.broad_phase();
            let pairs = self.interact();
            self.update();
            self.render(renderer);
            let swapped = self.running.swapped(self.frame, &self.clock);
            on_frame(&FrameRecord { frame: self.frame, swapped, pairs });
            self.world.outside.swapped(self.frame);
            self.frame += 1;
        }
        Ok(())
    }

    fn frame(&self) -> u64 {
        self.frame
    }

    fn visit(&self, visit: &mut dyn FnMut(&Object)) {
        world::visit(&self.world.blocks, visit);
    }

    fn mailbox(&self) -> &Mailbox {
        self.world.outside.mailbox()
    }

    fn change(&mut self, change: &mut dyn FnMut(&mut Stages)) {
        self.world.change(change);
    }

    fn into_scene(self: Box<Self>) -> Scene {
        self.world.into_scene(self.frame)
    }

    fn watch(&mut self, timeline: Arc<Timeline>) {
        self.clock.watch(timeline, 0);
    }

    fn stage_seconds(&self) -> Vec<StageSeconds> {
        vec![self.clock.seconds(&self.running)]
    }
}

//! The dual-frame pipeline (§5) over the core: blocks are its units, threads its workers.
//!
//! Frames run in batches of up to [`FRAMES_PER_BLOCKING`](crate::blocking::FRAMES_PER_BLOCKING). Between two
//! batches the pipeline is at rest: blocks are formed anew before every frame whose number is a multiple of it,
//! a table that was too small, or half full, is given more room, threads join. Until it has room, contacts
//! and letters that do not fit are kept beside it. Threads, and the memory they work in, are kept from one run
//! to the next.

mod clock;
mod host;
mod layout;
mod memory;
mod overflow;
mod run;
mod team;

use std::panic::resume_unwind;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use dualframe_core::error::TableFull;
use dualframe_core::inbox::From;
use dualframe_core::pipeline::{BroadPhase, Config, Pipeline};

pub use dualframe_core::frame::Entry;

use self::clock::Times;
use self::host::{Parcel, Screen, Shared};
use self::layout::Layout;
use self::overflow::Overflow;
use self::run::{Context, End, Regrouping, Report};
use self::team::Team;
use super::outside::Outside;
use super::{Executor, ExecutorError, FrameRecord, OnFrame, Refused, StageSeconds, world};
use crate::block::Block;
use crate::blocking::Grain;
use crate::cost::TimedCost;
use crate::mailbox::Mailbox;
use crate::message::Letter;
use crate::object::{Object, ObjectId};
use crate::pool::{Crew, Pool};
use crate::render::Renderer;
use crate::scene::Scene;
use crate::stages::{PairCount, Stages};
use crate::timeline::Timeline;

/// Frames that a pipeline is built for at most; 2³¹: the core's frame numbers come round after twice as many.
const MOST_FRAMES: u64 = 1 << 31;

/// Advances an environment by the pipeline. The calling thread is worker number 0; who updates objects renders them,
/// unless the renderer [is bound](Renderer::is_bound) to the calling thread: then that does.
pub struct PipelineExecutor {
    stages: Stages,
    layout: Layout,
    entry: Entry,
    grain: Grain,
    pool: Arc<Pool>,
    team: Team,
    frame: u64,
    /// What rendering takes in a frame, where it stays with the calling thread.
    rendering: TimedCost,
    /// Objects' messages for the next frame.
    mail: Vec<(From, Parcel)>,
    outside: Outside,
    times: Vec<Times>,
    timeline: Option<Arc<Timeline>>,
    failure: Option<TableFull>,
}

impl PipelineExecutor {
    /// An executor of `scene` on the threads of `pool`, which may be resized at any time: for more threads than
    /// blocks were formed for they are formed anew.
    ///
    /// # Errors
    /// More objects than the grain allows, numbers of objects that are not 0, 1, 2 … without gaps, or threads that
    /// cannot be had.
    pub fn new(
        scene: Scene,
        grain: Grain,
        entry: Entry,
        pool: Arc<Pool>,
    ) -> Result<Self, Box<Refused>> {
        let threads = pool.threads();
        let (scene, team) = Refused::unless(scene, grain, threads, || Team::of(threads))?;
        let Scene { objects, stages, frame, mail: under_way, mailbox } = scene;
        let layout = Layout::new(objects, &stages, grain, threads);
        let mut mail = Vec::new();
        let outside = Outside::new(mailbox, under_way, frame, |from, to, message| {
            let from = From { sender: from.0, sequence: mail.len() as u32 };
            mail.push((from, Parcel { to, message }));
        });
        Ok(Self {
            stages,
            layout,
            entry,
            grain,
            pool,
            team,
            frame,
            rendering: TimedCost::default(),
            mail,
            outside,
            times: Vec::new(),
            timeline: None,
            failure: None,
        })
    }

    /// Runs up to `frames` frames with tables and team as they are, and says why it ended.
    fn run(
        &mut self,
        workers: usize,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<End, ExecutorError> {
        let Layout { blocks, blocking, tables, register, room, homes, .. } = &mut self.layout;
        let limits = tables.limits(blocks.len());
        let overflow = Overflow::default();
        let shared = Shared {
            stages: &self.stages,
            outside: &self.outside,
            register,
            overflow: &overflow,
            first_frame: self.frame,
            room: *room,
        };
        let broad_phase = match self.grain {
            Grain::Spatial => BroadPhase::Spatial,
            Grain::Pairwise => BroadPhase::Pairwise,
        };
        let config = Config { broad_phase, entry: self.entry, tokens: 1, homes: *homes };
        tables.load(blocks);
        let crew = Crew::default();
        let pipeline = match Pipeline::new(tables.lend(), config, &crew) {
            Ok(pipeline) => pipeline,
            Err(error) => {
                tables.unload(blocks);
                return Err(error.into());
            }
        };
        let times = std::mem::take(&mut self.times);
        let report = Mutex::new(Report { times, failure: None });
        let context = Context {
            shared: &shared,
            crew: &crew,
            pool: &self.pool,
            team: &self.team,
            workers,
            report: &report,
            timeline: self.timeline.as_deref(),
        };
        let regrouping = Regrouping {
            blocking: (self.grain == Grain::Spatial).then_some((blocking, &mut *blocks)),
            mail: &mut self.mail,
            homes: *homes,
            limits,
        };
        let screen = Screen {
            renderer,
            on_frame,
            pairs: PairCount::default(),
            took: Duration::ZERO,
            rendering: &mut self.rendering,
            frame: &mut self.frame,
        };
        let ended = context.run(frames, pipeline, regrouping, screen);
        let report = report.into_inner().unwrap_or_else(PoisonError::into_inner);
        tables.unload(blocks);
        (self.times, self.failure) = (report.times, report.failure);
        let end = ended.unwrap_or_else(|panic| resume_unwind(panic));
        self.failure.map_or(Ok(end), |full| Err(full.into()))
    }

    /// A frame without objects: it has no last one, by which it would be swapped.
    fn swap_nothing(&mut self, renderer: &mut dyn Renderer, on_frame: &mut OnFrame<'_>) {
        renderer.swap(self.frame);
        let (swapped, pairs) = (Instant::now(), PairCount::default());
        on_frame(&FrameRecord { frame: self.frame, swapped, pairs });
        self.outside.swapped(self.frame);
        self.frame += 1;
    }
}

impl Executor for PipelineExecutor {
    fn advance(
        &mut self,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        let end = self.frame.saturating_add(frames);
        if let Some(full) = self.failure {
            return Err(full.into());
        }
        // What came from outside is taken, and recorded, with the first frame: not where there will be none.
        self.team.grow(self.pool.threads())?;
        self.outside.begin(self.frame);
        while self.frame < end {
            if self.layout.blocks.is_empty() {
                self.swap_nothing(renderer, on_frame);
                continue;
            }
            let workers = self.pool.threads();
            self.team.grow(workers)?;
            self.layout.suit(workers, &self.stages, self.grain);
            let frames = (end - self.frame).min(MOST_FRAMES);
            if let End::Outgrown(table, to) = self.run(workers, frames, renderer, on_frame)? {
                self.layout.grow(table, to);
            }
        }
        Ok(())
    }

    fn frame(&self) -> u64 {
        self.frame
    }

    fn visit(&self, visit: &mut dyn FnMut(&Object)) {
        self.layout.blocks.iter().flat_map(Block::objects).for_each(visit);
    }

    fn mailbox(&self) -> &Mailbox {
        self.outside.mailbox()
    }

    fn change(&mut self, change: &mut dyn FnMut(&mut Stages)) {
        if world::changes_pairs(&mut self.stages, change) && self.grain == Grain::Pairwise {
            self.layout.model(&self.stages);
        }
    }

    fn into_scene(mut self: Box<Self>) -> Scene {
        self.mail.sort_unstable_by_key(|(from, parcel)| (parcel.to, from.sender, from.sequence));
        let due = self.frame;
        let mail = self.mail.into_iter().map(|(from, Parcel { to, message })| Letter {
            due,
            to,
            from: ObjectId(from.sender),
            message,
        });
        let objects = self.layout.blocks.into_iter().flat_map(|block| block.objects);
        world::scene(objects, self.stages, due, mail, &self.outside)
    }

    fn watch(&mut self, timeline: Arc<Timeline>) {
        self.timeline.get_or_insert(timeline);
    }

    fn stage_seconds(&self) -> Vec<StageSeconds> {
        self.times.iter().map(Times::seconds).collect()
    }
}

#[cfg(test)]
mod tests {
    use dualframe_core::error::Table;

    use super::*;
    use crate::executor::{SerialExecutor, state_hash};
    use crate::render::NullRenderer;
    use crate::scene::ParticleScene;

    fn executor(scene: Scene, threads: usize) -> PipelineExecutor {
        let pool = Arc::new(Pool::new(threads, false));
        PipelineExecutor::new(scene, Grain::Spatial, Entry::default(), pool).expect("a valid scene")
    }

    fn advance(executor: &mut PipelineExecutor, frames: u64) {
        let advanced = executor.advance(frames, &mut NullRenderer::new(), &mut |_| ());
        advanced.expect("the tables hold all");
    }

    #[test]
    fn frames_run_one_by_one_are_regrouped_as_others() {
        let grouped = |runs: u64, frames: u64| -> Vec<Vec<ObjectId>> {
            // Between several homes objects are shared out by what they took, which is never twice the same.
            let mut executor = executor(ParticleScene::new(200).build().expect("a valid scene"), 1);
            (0..runs).for_each(|_| advance(&mut executor, frames));
            let numbers = |block: &Block| block.objects().iter().map(Object::id).collect();
            let mut blocks: Vec<_> = executor.layout.blocks.iter().map(numbers).collect();
            // The longest come first.
            blocks.sort_unstable();
            blocks
        };
        let regrouped = grouped(1, 65);
        assert_eq!(grouped(65, 1), regrouped);
        assert_eq!(grouped(13, 5), regrouped);
        assert_ne!(grouped(1, 64), regrouped, "nobody moves from block to block");
    }

    #[test]
    fn more_threads_get_as_many_blocks_and_homes_as_if_they_had_been_there() {
        let scene = || ParticleScene::new(300).build().expect("a valid scene");
        let sizes =
            |executor: &PipelineExecutor| (executor.layout.blocks.len(), executor.layout.homes);
        let (mut grown, mut large) = (executor(scene(), 1), executor(scene(), 8));
        advance(&mut grown, 40);
        assert_eq!((sizes(&grown).1, sizes(&large).1), (1, 8));
        let room = grown.layout.tables.contact_capacity();
        grown.layout.grow(Table::Contacts, room);
        let room = grown.layout.tables.contact_capacity();
        grown.pool.resize(8);
        advance(&mut grown, 40);
        assert_eq!(sizes(&grown), sizes(&large));
        assert_eq!(grown.layout.tables.contact_capacity(), room, "what has grown is kept");
        grown.pool.resize(2);
        advance(&mut grown, 40);
        assert_eq!(sizes(&grown), sizes(&large), "they may come back");
        advance(&mut large, 120);
        assert_eq!(state_hash(&grown), state_hash(&large));
    }

    #[test]
    fn tables_grow_after_one_frame() {
        let mut scene = ParticleScene::new(60).build().expect("a valid scene");
        let first = scene.objects[0].geometry.as_mesh().expect("a particle").positions.clone();
        for object in scene.objects.iter_mut().take(14) {
            object.geometry.as_mesh_mut().expect("a particle").positions = first.clone();
            object.refit();
        }
        let mut executor = executor(scene, 2);
        let before = executor.layout.tables.contact_capacity();
        advance(&mut executor, 1);
        assert_eq!(executor.layout.tables.contact_capacity(), 2 * before);
    }

    /// Contacts for which there is no room are handed over all the same.
    #[test]
    fn what_does_not_fit_is_not_lost() {
        let scene = || {
            let mut scene = ParticleScene::new(60).build().expect("a valid scene");
            let mesh = |object: &mut Object| object.geometry.as_mesh_mut().cloned();
            let first = mesh(&mut scene.objects[0]).expect("a particle").positions;
            for object in scene.objects.iter_mut().take(24) {
                object.geometry.as_mesh_mut().expect("a particle").positions = first.clone();
                object.refit();
            }
            scene
        };
        let mut serial = SerialExecutor::new(scene(), Grain::Spatial).expect("a valid scene");
        let advanced = serial.advance(3, &mut NullRenderer::new(), &mut |_| ());
        advanced.expect("nothing can be full");
        for threads in [1, 2] {
            let mut executor = executor(scene(), threads);
            advance(&mut executor, 3);
            assert_eq!(state_hash(&executor), state_hash(&serial), "{threads} threads");
        }
    }
}

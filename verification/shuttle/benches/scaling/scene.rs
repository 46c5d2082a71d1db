//! Particles in blocks, as far as their callbacks take time: blocks of a square, each beside up to eight others.

use std::sync::atomic::{AtomicU64, Ordering};

use dut::contacts::{ContactSlot, Contacts, SegmentSlot};
use dut::environment::{Environment, Pair};
use dut::error::TableFull;
use dut::frame::Frame;
use dut::inputs::Inputs;
use dut::pipeline::{Config, MOST_HOMES, Pipeline};
use dut::ring::QueueSlot;
use dut::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dut::unit::UnitId;

use crate::dut;
use crate::machine::{Looking, core, forget_spent, now, spend, transfer};

/// What an object's update takes, its bounding box included; usually 650 ns, of a frame of 1 µs an object (DESIGN §7,
/// "Grain decides", as all of these).
const UPDATE: u64 = 650;
/// What its interactions take; usually 330 ns, half of it with those of its own block.
const INTERACTION: u64 = 330;
/// What handing it to a renderer takes, which does not read it; usually 20 ns.
const RENDERING: u64 = 20;
/// A test of two bounding boxes; usually 4 ns.
const TEST: u64 = 4;
/// By how much updates of a block differ from frame to frame, to either side; usually 5 %.
const UNEVENNESS: u64 = 5;
/// Lines of an object's data; usually 16: 42 nodes' positions and velocities.
const LINES: u64 = 16;
/// Lines that a core fetches at a time; usually 10.
const AT_A_TIME: u64 = 10;
/// Of an object's lines those that another block's interaction with it reads, one in so many; usually 4.
const READ_BY_OTHERS: u64 = 4;
/// Contacts of an interaction; usually 4.
const CONTACTS: usize = 4;

/// So many objects in blocks, and how long to run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scene {
    pub(crate) objects: u64,
    pub(crate) blocks: u32,
    /// Frames before those that are measured.
    pub(crate) warm_up: u32,
    pub(crate) frames: u32,
}

/// A unit: objects that are close to each other.
pub(crate) struct Block {
    number: u32,
    /// Which cores have all of its objects in their caches, one bit each: its last updater's, to begin with.
    cached: AtomicU64,
    /// Which have what others' interactions with it read.
    border_cached: AtomicU64,
}

/// What is read of a block.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    All,
    Border,
}

/// When frames were swapped.
#[derive(Debug, Default)]
pub(crate) struct Screen(Vec<u64>);

impl Screen {
    /// What a frame took, in ns.
    pub(crate) fn frame_time(&self, scene: &Scene) -> f64 {
        let first = self.0[scene.warm_up as usize - 1];
        let last = self.0[(scene.warm_up + scene.frames) as usize - 1];
        (last - first) as f64 / f64::from(scene.frames)
    }
}

impl Scene {
    /// Blocks of a row: they form a square, whose last row may be short.
    fn row(&self) -> u32 {
        self.blocks.isqrt()
    }

    fn are_close(&self, a: u32, b: u32) -> bool {
        let row = self.row();
        (a / row).abs_diff(b / row) <= 1 && (a % row).abs_diff(b % row) <= 1
    }

    /// What takes so long for an object takes this long for a block's.
    fn of_block(&self, time: u64) -> u64 {
        self.objects * time / u64::from(self.blocks)
    }

    /// Has a block's lines come to a core that has not got them: all, or those at its border.
    fn bring(&self, block: &Block, part: Part) {
        let bit = 1 << core();
        let has = |cores: &AtomicU64| cores.load(Ordering::Relaxed) & bit != 0;
        let border = LINES / READ_BY_OTHERS;
        let lines = match part {
            _ if has(&block.cached) => 0,
            Part::All if has(&block.border_cached) => LINES - border,
            Part::All => LINES,
            Part::Border if has(&block.border_cached) => 0,
            Part::Border => border,
        };
        if lines > 0 {
            spend("data", self.of_block(lines * transfer()) / AT_A_TIME);
        }
        block.border_cached.fetch_or(bit, Ordering::Relaxed);
        if part == Part::All {
            block.cached.fetch_or(bit, Ordering::Relaxed);
        }
    }

    /// A number of percent that differs from block to block and frame to frame (splitmix64's finaliser).
    fn percent(unit: UnitId, frame: Frame) -> u64 {
        let mut z =
            (u64::from(unit.0) << 32 | u64::from(frame.0)).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        100 - UNEVENNESS + (z ^ (z >> 31)) % (2 * UNEVENNESS + 1)
    }
}

impl Environment for Scene {
    type Object = Block;
    type Interaction = ();
    type Contact = u64;
    type Message = ();
    type Renderer = Screen;
    type Error = TableFull;

    fn broad_phase(&self, a: &Block, b: &Block) -> bool {
        spend("callbacks", TEST);
        self.are_close(a.number, b.number)
    }

    fn interacts_within(&self, _: &Block) -> bool {
        true
    }

    fn interact(
        &self,
        pair: Pair,
        a: &Block,
        b: &Block,
        (): &mut (),
        contacts: &mut Contacts<'_, '_, u64>,
    ) -> Result<(), TableFull> {
        let [first, second] = pair.ends;
        if first == second {
            self.bring(a, Part::All);
        } else {
            self.bring(a, Part::Border);
            self.bring(b, Part::Border);
        }
        // Each block has one interaction within, and four with others, as half of eight are another's.
        let share = if first == second { 2 } else { 8 };
        spend("callbacks", self.of_block(INTERACTION) / share);
        contacts.push(&[0; CONTACTS])
    }

    fn update(
        &self,
        unit: UnitId,
        frame: Frame,
        block: &mut Block,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), TableFull> {
        self.bring(block, Part::All);
        let found = inputs.interactions_in_any_order().count();
        assert!(found > 0, "no block is without one");
        *block.cached.get_mut() = 1 << core();
        *block.border_cached.get_mut() = 1 << core();
        spend("callbacks", self.of_block(UPDATE) * Self::percent(unit, frame) / 100);
        Ok(())
    }

    fn render(&self, _: UnitId, _: Frame, _: &Block, _: &mut Screen) -> Result<(), TableFull> {
        spend("callbacks", self.of_block(RENDERING));
        Ok(())
    }

    fn swap(&self, _: Frame, screen: &mut Screen) -> Result<(), TableFull> {
        screen.0.push(now());
        if screen.0.len() == self.warm_up as usize {
            forget_spent();
        }
        Ok(())
    }
}

/// The memory of a pipeline of this scene.
pub(crate) struct Slots {
    units: Vec<UnitSlot<Block>>,
    interactions: Vec<InteractionSlot<()>>,
    contacts: Vec<ContactSlot<u64>>,
    segments: Vec<SegmentSlot>,
    queues: Vec<QueueSlot>,
}

impl Slots {
    pub(crate) fn new(scene: &Scene, homes: u32) -> Self {
        let blocks = scene.blocks as usize;
        // Twice as many as one frame's: within each block, and half of eight neighbours.
        let interactions = 2 * 5 * blocks;
        let contacts = interactions * CONTACTS;
        let queues = queue_slots(blocks, interactions, 0, homes as usize);
        let block = |number| {
            UnitSlot::new(Block {
                number,
                cached: AtomicU64::new(0),
                border_cached: AtomicU64::new(0),
            })
        };
        Self {
            units: (0..scene.blocks).map(block).collect(),
            interactions: (0..interactions).map(|_| InteractionSlot::spare(())).collect(),
            contacts: (0..contacts).map(|_| ContactSlot::new()).collect(),
            segments: (0..contacts).map(|_| SegmentSlot::new()).collect(),
            queues: (0..queues).map(|_| QueueSlot::new()).collect(),
        }
    }

    /// A pipeline that all frames are let run of, with a renderer for whoever has something to render.
    pub(crate) fn pipeline(&mut self, scene: &Scene, homes: u32) -> Pipeline<'_, Scene, Looking> {
        let memory = Memory {
            units: &mut self.units,
            interactions: &mut self.interactions,
            contacts: &mut self.contacts,
            segments: &mut self.segments,
            letters: &mut [],
            queues: &mut self.queues,
        };
        let homes = homes.min(MOST_HOMES as u32);
        let config = Config { homes, ..Config::default() };
        let mut pipeline = Pipeline::new(memory, config, Looking).expect("memory that fits");
        pipeline.set_homes(|unit| unit.0 * homes / scene.blocks);
        pipeline.share(Screen::default()).map_err(drop).expect("no token is out");
        pipeline.run(scene.warm_up + scene.frames).expect("a pipeline at rest");
        pipeline
    }
}

//! The callbacks: the bodies' arithmetic, random costs, faults on purpose, and a record of each.

use std::sync::Mutex;

use dualframe_core::contacts::Contacts;
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::TableFull;
use dualframe_core::frame::Frame;
use dualframe_core::inputs::Inputs;
use dualframe_core::pipeline::BroadPhase;
use dualframe_core::unit::UnitId;

use crate::body::{Body, Memory, draw, letters, respond};
use crate::random_ve::{Case, Fault};
use crate::trace::{Act, Record, Trace};

/// One thread's callbacks.
#[derive(Debug)]
pub struct Host<'c> {
    /// The environment.
    pub case: &'c Case,
    /// Where the clock is.
    pub trace: &'c Trace,
    /// The thread's number.
    pub thread: u32,
    /// What this thread did. Locked by this thread only: a mutex because hosts are `Sync`.
    pub log: Mutex<Vec<Record>>,
}

/// What a token owns.
#[derive(Debug)]
pub struct Screen {
    /// Its number; no two live at once with the same.
    pub token: u32,
}

/// What a callback fails with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    /// On purpose: where, in which frame, and at which unit or units.
    Fault(Fault, u32, [u32; 2]),
    /// A table that should have been large enough was not.
    Full(TableFull),
    /// Memory that another interaction wrote.
    Torn(Memory),
}

impl From<TableFull> for Failure {
    fn from(full: TableFull) -> Self {
        Self::Full(full)
    }
}

impl Host<'_> {
    fn record(&self, begin: u64, act: Act) {
        let record = Record { begin, end: self.trace.tick(), thread: self.thread, act };
        self.log.lock().expect("no poison").push(record);
    }

    /// Takes a random time, and gives the processor away now and then.
    fn dawdle(&self, stage: u32, frame: u32, about: [u32; 2]) {
        let drawn = draw(self.case.seed, &[20 + stage, frame, about[0], about[1], self.thread]);
        for _ in 0..drawn % 128 {
            std::hint::spin_loop();
        }
        if (drawn >> 32).is_multiple_of(8) {
            std::thread::yield_now();
        }
    }

    fn fault(&self, at: Fault, frame: u32, about: [u32; 2]) -> Result<(), Failure> {
        match self.case.fails(at, frame, about) {
            Some(_) => Err(Failure::Fault(at, frame, about)),
            None => Ok(()),
        }
    }
}

fn numbers(units: [UnitId; 2]) -> [u32; 2] {
    units.map(|unit| unit.0)
}

impl Environment for Host<'_> {
    type Object = Body;
    type Interaction = Memory;
    type Contact = f32;
    type Message = u64;
    type Renderer = Screen;
    type Error = Failure;

    fn broad_phase(&self, a: &Body, b: &Body) -> bool {
        let begin = self.trace.tick();
        let (ends, seen) = ([a.unit, b.unit], [a.age, b.age]);
        self.dawdle(0, seen[0], ends);
        let accepted = a.near(b);
        self.record(begin, Act::Test { ends, seen, accepted });
        accepted
    }

    fn interacts_within(&self, body: &Body) -> bool {
        let begin = self.trace.tick();
        let accepted = body.folds_now();
        self.record(begin, Act::Within { unit: body.unit, seen: body.age, accepted });
        accepted
    }

    fn interact(
        &self,
        pair: Pair,
        a: &Body,
        b: &Body,
        state: &mut Memory,
        contacts: &mut Contacts<'_, '_, f32>,
    ) -> Result<(), Failure> {
        let begin = self.trace.tick();
        let (frame, ends, seen) = (pair.frame.0, numbers(pair.ends), [a.age, b.age]);
        let stays = self.case.broad_phase == BroadPhase::Pairwise;
        let records = respond(self.case.seed, frame, a, b, state, stays);
        self.dawdle(1, frame, ends);
        let outcome = self
            .fault(Fault::Interact, frame, ends)
            .and_then(|()| records.iter().try_for_each(|records| Ok(contacts.push(records)?)));
        self.record(begin, Act::Interact { id: pair.id.0, ends, frame, seen });
        outcome
    }

    fn update(
        &self,
        unit: UnitId,
        frame: Frame,
        body: &mut Body,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), Failure> {
        let begin = self.trace.tick();
        let seen = body.age;
        let fails = self.case.fails(Fault::Update, frame.0, [unit.0; 2]);
        let refused = fails == Some(0);
        let mut outcome = self.fault(Fault::Update, frame.0, [unit.0; 2]);
        self.dawdle(2, frame.0, [unit.0; 2]);
        if !refused && let Err(failure) = self.live(unit.0, frame.0, body, inputs) {
            outcome = Err(failure);
        }
        body.age += 1;
        self.record(begin, Act::Update { unit: unit.0, frame: frame.0, seen, refused });
        outcome
    }

    fn render(
        &self,
        unit: UnitId,
        frame: Frame,
        body: &Body,
        screen: &mut Screen,
    ) -> Result<(), Failure> {
        let begin = self.trace.tick();
        let (frame, seen) = (frame.0, body.age);
        self.dawdle(3, frame, [unit.0; 2]);
        self.record(begin, Act::Render { unit: unit.0, frame, seen, token: screen.token });
        self.fault(Fault::Render, frame, [unit.0; 2])
    }

    fn swap(&self, frame: Frame, screen: &mut Screen) -> Result<(), Failure> {
        let begin = self.trace.tick();
        self.dawdle(4, frame.0, [0; 2]);
        self.record(begin, Act::Swap { frame: frame.0, token: screen.token });
        self.fault(Fault::Swap, frame.0, [0; 2])
    }
}

impl Host<'_> {
    /// An update that did not refuse: hears, feels, moves, posts.
    fn live(
        &self,
        unit: u32,
        frame: u32,
        body: &mut Body,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), Failure> {
        let mut outcome = Ok(());
        let mut begin = self.trace.tick();
        while let Some((from, word)) = inputs.next_letter() {
            body.hear(from.sender, from.sequence, word);
            let rank = (from.sender, from.sequence);
            self.record(begin, Act::Read { unit, frame, rank });
            begin = self.trace.tick();
        }
        for interaction in inputs.interactions() {
            let (other, memory) = (interaction.other.0, interaction.state);
            if memory.frame != frame || memory.ends != [unit.min(other), unit.max(other)] {
                outcome = Err(Failure::Torn(*memory));
            }
            body.meet(other, memory);
            interaction.contacts.flatten().for_each(|&record| body.feel(record));
        }
        body.travel();
        let units = self.case.units.len() as u32;
        for (k, (to, word)) in letters(self.case.seed, units, unit, frame).enumerate() {
            let begin = self.trace.tick();
            match inputs.post(UnitId(to), unit, word) {
                Ok(()) => {
                    let rank = (unit, k as u32);
                    self.record(begin, Act::Post { to, due: frame + 1, rank });
                }
                Err(rejected) => outcome = Err(Failure::Full(rejected.full)),
            }
        }
        outcome
    }
}

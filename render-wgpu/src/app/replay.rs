//! `dualframe replay`.

use std::fs::File;
use std::io::{self, BufReader, Write};
use std::path::Path;
use std::time::Instant;

use dualframe_sim::executor::ExecutorError;
use dualframe_sim::manager::VeManager;
use dualframe_sim::record::{Difference, ReadError, Replay, ReplayError, Step};
use dualframe_sim::render::NullRenderer;
use indicatif::ProgressBar;
use serde::Serialize;
use thiserror::Error;

use super::args::{ReplayArgs, frames_in_flight};
use super::error::RunError;
use super::outputs::{self, Output};
use super::scenes::{AnyScene, AnySceneError};
use super::{BAD_ARGUMENT, UNSOUND};

/// Why nothing of a recording can be played, or not all.
#[derive(Debug, Error)]
pub(super) enum ReplayFault {
    #[error("it cannot be read: {0}")]
    Open(io::Error),
    #[error(transparent)]
    Recording(#[from] ReadError),
    #[error(transparent)]
    Scene(#[from] AnySceneError),
    #[error(transparent)]
    Executor(#[from] ExecutorError),
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// What is to be written is what it is played from.
    #[error("{0}")]
    Output(String),
}

impl ReplayFault {
    /// The status that the program ends with if nothing is played.
    pub(super) fn status(&self) -> u8 {
        match self {
            // More objects than the broad phase asked for allows.
            Self::Executor(ExecutorError::Blocking(_)) => BAD_ARGUMENT,
            // As for any other run: no thread was to be had, say.
            Self::Executor(_) => UNSOUND,
            _ => BAD_ARGUMENT,
        }
    }
}

/// What came of a replay.
#[derive(Serialize)]
pub(super) struct ReplayReport {
    scene: &'static str,
    /// The version that recorded it.
    engine: String,
    executor: &'static str,
    threads: usize,
    simd: &'static str,
    frames_in_flight: u8,
    pub(super) frames: u64,
    /// Those that agreed.
    checkpoints: u64,
    /// From outside, of these frames.
    messages: u64,
    seconds: f64,
    fps: f64,
    state_hash: String,
    /// Whether it was played to the end and every checkpoint agreed.
    agrees: bool,
    difference: Option<DifferenceReport>,
    error: Option<String>,
    #[serde(skip)]
    pub(super) fault: Option<ReplayFault>,
}

/// The first checkpoint that did not agree.
#[derive(Serialize)]
struct DifferenceReport {
    frame: u64,
    expected: String,
    found: String,
    objects: Vec<ObjectReport>,
}

/// An object that differs there; nothing for a hash where it is not there.
#[derive(Serialize)]
struct ObjectReport {
    object: u32,
    expected: Option<String>,
    found: Option<String>,
}

fn hex(hash: u64) -> String {
    format!("{hash:016x}")
}

impl From<&Difference> for DifferenceReport {
    fn from(difference: &Difference) -> Self {
        let objects = difference.objects.iter().map(|differs| ObjectReport {
            object: differs.object.0,
            expected: differs.expected.map(hex),
            found: differs.found.map(hex),
        });
        Self {
            frame: difference.frame,
            expected: hex(difference.expected),
            found: hex(difference.found),
            objects: objects.collect(),
        }
    }
}

/// Replays a recording as `args` say. `json` is what is written afterwards.
///
/// # Errors
/// Nothing of it can be played.
pub(super) fn run(args: &ReplayArgs, json: Option<&Output>) -> Result<ReplayReport, ReplayFault> {
    let check = |input: Option<&Path>| {
        let files = json.map(Output::path).into_iter().chain(input);
        outputs::check_distinct(files).map_err(ReplayFault::Output)
    };
    check(Some(&args.file))?;
    let file = File::open(&args.file).map_err(ReplayFault::Open)?;
    let mut replay = Replay::new(BufReader::new(file))?;
    let any = AnyScene::of(replay.header())?;
    check(any.input())?;
    let mut scene = any.build(args.way.simd())?;
    replay.begin(&mut scene);
    let settings = args.way.settings(any.grain());
    let manage = |scene| VeManager::new(scene, settings).map_err(ExecutorError::from);
    let mut manager = manage(scene)?;
    let bar = ProgressBar::new_spinner();
    let began = Instant::now();
    let (manager, fault) = loop {
        let step = replay.advance(&mut manager, u64::MAX, &mut NullRenderer::new(), &mut |_| {
            bar.inc(1);
        });
        match step {
            Ok(Step::Over) => break (manager, None),
            Ok(Step::Advanced | Step::Agrees { .. }) => {
                bar.set_message(format!("frame {}", manager.frame()));
            }
            Ok(Step::Objects(spec)) => {
                let mut scene = manager.into_scene();
                let added = any.add(&mut scene, &spec);
                manager = manage(scene)?;
                if let Err(error) = added {
                    break (manager, Some(error.into()));
                }
            }
            Err(error) => break (manager, Some(error.into())),
        }
    };
    let seconds = began.elapsed().as_secs_f64();
    bar.finish_and_clear();
    match fault {
        Some(ReplayFault::Replay(ReplayError::Recording(error))) if manager.frame() == 0 => {
            Err(error.into())
        }
        Some(fault @ ReplayFault::Scene(_)) if manager.frame() == 0 => Err(fault),
        fault => Ok(report(args, (&any, &replay, &manager), seconds, fault)),
    }
}

fn report(
    args: &ReplayArgs,
    (any, replay, manager): (&AnyScene, &Replay<BufReader<File>>, &VeManager),
    seconds: f64,
    fault: Option<ReplayFault>,
) -> ReplayReport {
    let difference = match &fault {
        Some(ReplayFault::Replay(ReplayError::Differs(difference))) => Some(difference.into()),
        _ => None,
    };
    let frames = manager.frame();
    let settings = manager.settings();
    ReplayReport {
        scene: any.kind(),
        engine: replay.header().engine().to_owned(),
        executor: settings.executor.name(),
        threads: settings.threads,
        simd: args.way.simd().instructions().name(),
        frames_in_flight: frames_in_flight(&settings),
        frames,
        checkpoints: replay.checkpoints(),
        messages: replay.letters(),
        seconds,
        fps: frames as f64 / seconds.max(f64::MIN_POSITIVE),
        state_hash: hex(manager.state_hash()),
        agrees: fault.is_none(),
        difference,
        error: fault.as_ref().map(|fault| super::with_causes(fault)),
        fault,
    }
}

impl ReplayReport {
    /// Prints the closing lines.
    pub(super) fn print(&self) -> Result<(), RunError> {
        outputs::print(|out| self.lines(out))
    }

    fn lines(&self, out: &mut impl Write) -> io::Result<()> {
        let Self { scene, engine, frames, checkpoints, messages, .. } = self;
        let engine = super::one_line(engine);
        writeln!(out, "{scene}, recorded by version {engine}: {frames} frames replayed")?;
        writeln!(out, "{messages} messages from outside; {checkpoints} checkpoints agree")?;
        let Self { executor, threads, simd, fps, seconds, .. } = self;
        writeln!(out, "{executor} on {threads} threads ({simd}): {fps:.1} fps, {seconds:.3} s")?;
        writeln!(out, "state hash: {}", self.state_hash)
    }

    /// Writes the report as one JSON object.
    pub(super) fn write(&self, file: &Output) -> Result<(), RunError> {
        file.write_json(self)
    }
}

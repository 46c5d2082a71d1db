//! The command line.

mod values;

use std::path::PathBuf;

use clap::error::ErrorKind;
use clap::{Args, Parser, Subcommand, ValueEnum};
use dualframe_sim::blocking::{Blocking, Grain};
use dualframe_sim::device::thread::{MAX_RATE, MIN_RATE, RATE};
use dualframe_sim::executor::{Entry, ExecutorKind, MAX_THREADS};
use dualframe_sim::experiment::Experiment;
use dualframe_sim::experiment::plan::Plan;
use dualframe_sim::manager::Settings;
use dualframe_sim::pool::cores;
use dualframe_sim::scene::ParticleScene;
use dualframe_sim::scene::craniotomy::Step;
use dualframe_sim::simd::{Instructions, Simd};

use self::values::{
    executor_names, parse_executor, parse_objects, parse_rate, parse_simd, parse_size, parse_step,
    parse_threads,
};

/// The most frames of one run: each takes 24 bytes of the report.
const MAX_FRAMES: u64 = 10_000_000;
/// Frames of a run without a window.
const USUAL_FRAMES: u64 = 800;
/// The most particles whose every pair can be modelled; the six walls come on top.
const MAX_PAIRWISE: usize = Blocking::MAX_PAIRWISE_OBJECTS - 6;

/// Realtime, physically based virtual environments on all cores.
#[derive(Parser)]
#[command(
    name = "dualframe",
    version,
    args_conflicts_with_subcommands = true,
    allow_negative_numbers = true
)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    particles: Particles,
}

#[derive(Subcommand)]
enum Command {
    /// Deformable particles in a room of six walls (the default).
    Particles(Particles),
    /// A craniotomy: two tools, 27 soft structures and the skull.
    Craniotomy(CraniotomyArgs),
    /// A recorded session once more, checked bit for bit.
    Replay(ReplayArgs),
    /// The paper's experiments on this machine: tables (CSV), figures (SVG, PNG) and a page.
    Experiment(ExperimentArgs),
}

/// Arguments of the experiments.
#[derive(Args)]
pub(in crate::app) struct ExperimentArgs {
    /// Which experiment.
    #[arg(value_enum)]
    which: ExperimentName,
    /// Smaller sizes: a few minutes for all on two cores.
    #[arg(long)]
    quick: bool,
    /// What `compare` runs; `all` runs both
    #[arg(long, value_name = "NAME", value_enum)]
    scene: Option<SceneName>,
    /// The folder to write into, which is made if it is not there. Files of an earlier run are replaced,
    /// and the page shows the experiments of this run alone.
    #[arg(long, value_name = "DIR")]
    pub(in crate::app) out: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum ExperimentName {
    /// Figs. 11 to 13: throughput, speed-up and efficiency.
    Scalability,
    /// Fig. 14 and Table 1: seconds of each worker in each stage.
    LoadBalance,
    /// Fig. 15: collisions and speed-up of each frame.
    PerFrame,
    /// Figs. 16 and 17, or Fig. 18: the pipeline against every other executor.
    Compare,
    /// All of them.
    All,
}

#[derive(Clone, Copy, ValueEnum)]
enum SceneName {
    /// Figs. 16 and 17 (the default).
    Particles,
    /// Fig. 18: automated retraction.
    Craniotomy,
}

impl ExperimentArgs {
    pub(in crate::app) fn experiments(&self) -> Vec<Experiment> {
        match self.which {
            ExperimentName::Scalability => vec![Experiment::Scalability],
            ExperimentName::LoadBalance => vec![Experiment::LoadBalance],
            ExperimentName::PerFrame => vec![Experiment::PerFrame],
            ExperimentName::Compare => match self.scene {
                Some(SceneName::Craniotomy) => vec![Experiment::Retraction],
                Some(SceneName::Particles) | None => vec![Experiment::Compare],
            },
            ExperimentName::All => Experiment::ALL.to_vec(),
        }
    }

    pub(in crate::app) fn plan(&self) -> Plan {
        if self.quick { Plan::quick() } else { Plan::full() }
    }

    /// What fits no single argument.
    fn check(self) -> Result<Self, String> {
        match (self.which, self.scene) {
            (ExperimentName::Compare, _) | (_, None) => Ok(self),
            (_, Some(_)) => Err("--scene is for `compare` only".to_owned()),
        }
    }
}

/// How frames are run, which changes no result.
#[derive(Args)]
pub(in crate::app) struct Way {
    #[arg(long, value_name = "N", default_value_t = cores().min(MAX_THREADS),
          value_parser = parse_threads,
          help = format!("Number of threads, 1 to {MAX_THREADS}; all cores if not given"))]
    pub(in crate::app) threads: usize,
    #[arg(long, value_name = "NAME", default_value = ExecutorKind::Pipeline.name(),
          value_parser = parse_executor,
          help = format!("What drives the stages: {}", executor_names()))]
    pub(in crate::app) executor: ExecutorKind,
    /// Blocks of close objects, or every modelled pair; the scene's own if not given.
    #[arg(long, value_name = "KIND", value_enum)]
    broad_phase: Option<BroadPhaseName>,
    /// Frames that the pipeline works on at once, 1 or 2.
    #[arg(long, value_name = "N", default_value_t = 2,
          value_parser = clap::value_parser!(u8).range(1..=2))]
    pub(in crate::app) frames_in_flight: u8,
    #[arg(long, value_name = "NAME", value_parser = parse_simd,
          help = format!("Vector instructions of the kernels, {}; the widest that the machine has \
                          if not given", Instructions::ALL.map(Instructions::name).join(" or ")))]
    simd: Option<Simd>,
}

impl Way {
    fn grain(&self, usual: Grain) -> Grain {
        match self.broad_phase {
            Some(BroadPhaseName::Spatial) => Grain::Spatial,
            Some(BroadPhaseName::Pairwise) => Grain::Pairwise,
            None => usual,
        }
    }

    pub(in crate::app) fn simd(&self) -> Simd {
        self.simd.unwrap_or_else(Simd::detect)
    }

    /// `usual` is the scene's own broad phase.
    pub(in crate::app) fn settings(&self, usual: Grain) -> Settings {
        let Self { executor, threads, .. } = *self;
        let (grain, entry) = (self.grain(usual), entry(self.frames_in_flight));
        Settings { executor, threads, pinned: false, grain, entry }
    }
}

/// How far consecutive frames overlap where so many are in flight at once.
pub(in crate::app) fn entry(frames_in_flight: u8) -> Entry {
    if frames_in_flight == 1 { Entry::AfterSwap } else { Entry::AfterUpdate }
}

/// How many frames are in flight at once: what the pipeline lets enter says so, and only one other renders a frame
/// beside the next.
pub(in crate::app) fn frames_in_flight(settings: &Settings) -> u8 {
    match settings.executor {
        ExecutorKind::Pipeline if settings.entry != Entry::AfterSwap => 2,
        ExecutorKind::RayonOverlapped => 2,
        _ => 1,
    }
}

/// Arguments of a replay.
#[derive(Args)]
#[command(
    after_help = "Status 0: every checkpoint agreed. Status 1: one did not, or the file is damaged \
                        and what is whole of it was played. Status 2: nothing of it can be played."
)]
pub(in crate::app) struct ReplayArgs {
    /// The recording.
    #[arg(value_name = "FILE")]
    pub(in crate::app) file: PathBuf,
    #[command(flatten)]
    pub(in crate::app) way: Way,
    /// Write what came of it as JSON.
    #[arg(long, value_name = "FILE")]
    pub(in crate::app) json: Option<PathBuf>,
}

/// Arguments of the particle environment.
#[derive(Args)]
#[command(after_help = format!("With --broad-phase pairwise there can be {MAX_PAIRWISE} particles at most."))]
pub(in crate::app) struct Particles {
    /// Number of particles.
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = parse_objects,
          help = format!("Number of particles, 1 to {}", ParticleScene::MAX_OBJECTS))]
    pub(in crate::app) objects: usize,
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_FRAMES),
          help = format!("Number of frames, 1 to {MAX_FRAMES}; if not given, {USUAL_FRAMES}, or in a \
                          window until it is closed"))]
    pub(in crate::app) frames: Option<u64>,
    /// What velocities and substeps are drawn from.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(in crate::app) seed: u64,
    /// Let the particles fall.
    #[arg(long)]
    pub(in crate::app) gravity: bool,
    #[command(flatten)]
    pub(in crate::app) way: Way,
    #[command(flatten)]
    pub(in crate::app) products: Products,
}

/// What a run draws and writes.
#[derive(Args)]
pub(in crate::app) struct Products {
    /// Show a window, which is what happens where there is a display and nothing is asked for that runs without one:
    /// --headless, --offscreen, --picture or --frames-out
    #[arg(long, conflicts_with_all = ["headless", "offscreen", "frames_out"])]
    pub(in crate::app) window: bool,
    /// Run without a window
    #[arg(long, conflicts_with = "offscreen")]
    headless: bool,
    /// Draw every frame without a window
    #[arg(long)]
    pub(in crate::app) offscreen: bool,
    /// Write a picture of the last frame; without --window no window is shown
    #[arg(long, value_name = "FILE.png")]
    pub(in crate::app) picture: Option<PathBuf>,
    /// Write a picture of every frame, without a window, into a folder, which is made if it is not there
    #[arg(long, value_name = "DIR")]
    pub(in crate::app) frames_out: Option<PathBuf>,
    /// Width and height of window and pictures, in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse_size, allow_hyphen_values = true)]
    pub(in crate::app) size: (u32, u32),
    /// A part of the graphics adapter's name
    #[arg(long, value_name = "NAME")]
    pub(in crate::app) adapter: Option<String>,
    /// Write what each worker did in the last seconds, for chrome://tracing or ui.perfetto.dev
    #[arg(long, value_name = "FILE")]
    pub(in crate::app) trace: Option<PathBuf>,
    /// Record the session, for `dualframe replay`; starting anew in a window ends the recording
    #[arg(long, value_name = "FILE")]
    pub(in crate::app) record: Option<PathBuf>,
    /// Write the report as JSON.
    #[arg(long, value_name = "FILE")]
    pub(in crate::app) json: Option<PathBuf>,
}

impl Products {
    /// Whether a window is to be shown if there can be one: nothing else was asked for.
    pub(in crate::app) fn prefers_window(&self) -> bool {
        let pictures = self.picture.is_some() || self.frames_out.is_some();
        self.window || !(self.headless || self.offscreen || pictures)
    }
}

/// Arguments of the craniotomy.
#[derive(Args)]
pub(in crate::app) struct CraniotomyArgs {
    #[arg(long, value_name = "STEP", value_parser = parse_step,
          help = format!("How far a script operates: {}; in a window not at all if not given, else {}",
                         Step::ALL.map(Step::name).join(", "), Step::All.name()))]
    pub(in crate::app) step: Option<Step>,
    /// The patient's computed tomography, NIfTI or NRRD; a synthetic head if not given
    #[arg(long, value_name = "FILE")]
    pub(in crate::app) ct: Option<PathBuf>,
    /// Write the computed tomography as it is after the operation, as NIfTI
    #[arg(long, value_name = "FILE.nii.gz")]
    pub(in crate::app) save: Option<PathBuf>,
    /// Let the script operate through haptic devices, simulated in hands that give way, without a window
    #[arg(long, conflicts_with = "window")]
    pub(in crate::app) simulated_devices: bool,
    #[arg(long, value_name = "HZ", default_value_t = RATE, value_parser = parse_rate,
          help = format!("How often a second the hands' haptic loops tick, in a window or with \
                          --simulated-devices, {MIN_RATE} to {MAX_RATE}; simulated devices take 500 and more"))]
    pub(in crate::app) haptic_rate: f64,
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_FRAMES),
          help = format!("Number of frames, 1 to {MAX_FRAMES}; if not given, the operation's own, or in a \
                          window until it is closed"))]
    pub(in crate::app) frames: Option<u64>,
    #[command(flatten)]
    pub(in crate::app) way: Way,
    #[command(flatten)]
    pub(in crate::app) products: Products,
}

#[derive(Clone, Copy, ValueEnum)]
enum BroadPhaseName {
    Spatial,
    Pairwise,
}

impl Particles {
    /// The number of frames of a run without a window.
    pub(in crate::app) fn frames(&self) -> u64 {
        self.frames.unwrap_or(USUAL_FRAMES)
    }

    /// The most particles that the broad phase allows.
    pub(in crate::app) fn most_objects(&self) -> usize {
        match self.way.grain(Grain::Spatial) {
            Grain::Spatial => ParticleScene::MAX_OBJECTS,
            Grain::Pairwise => MAX_PAIRWISE,
        }
    }

    /// What fits no single argument.
    fn check(self) -> Result<Self, String> {
        let (objects, most) = (self.objects, self.most_objects());
        if objects > most {
            return Err(format!(
                "--objects {objects}: --broad-phase pairwise allows {most} particles"
            ));
        }
        Ok(self)
    }
}

/// What the arguments ask for.
pub(in crate::app) enum Outcome {
    Run(Particles),
    Operate(CraniotomyArgs),
    Replay(ReplayArgs),
    Experiment(ExperimentArgs),
    /// Help or version, already printed.
    Told,
    /// One line that says what is wrong.
    Bad(String),
}

pub(in crate::app) fn parse() -> Outcome {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return refuse(&error),
    };
    let particles = match cli.command {
        Some(Command::Particles(particles)) => particles,
        Some(Command::Craniotomy(craniotomy)) => return Outcome::Operate(craniotomy),
        Some(Command::Replay(replay)) => return Outcome::Replay(replay),
        Some(Command::Experiment(experiment)) => {
            return experiment.check().map_or_else(Outcome::Bad, Outcome::Experiment);
        }
        None => cli.particles,
    };
    particles.check().map_or_else(Outcome::Bad, Outcome::Run)
}

fn refuse(error: &clap::Error) -> Outcome {
    if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
        // A closed pipe is no concern of somebody who asked for help.
        let _printed = error.print();
        return Outcome::Told;
    }
    // The first line says what is wrong, or ends in a colon and the next ones say it; then comes usage.
    let text = error.to_string();
    let mut lines = text.lines();
    let mut line = lines.next().unwrap_or("bad arguments").to_owned();
    if line.ends_with(':') {
        for item in lines.map(str::trim).take_while(|item| !item.is_empty()) {
            line = line + " " + item;
        }
    }
    Outcome::Bad(line.strip_prefix("error: ").unwrap_or(&line).to_owned())
}

//! What drawing costs whoever holds the token, and executors with every frame drawn.
//!
//! `cargo bench -p dualframe-render-wgpu --features native-peers --bench drawing`; `-- --test` for a short run. An
//! adapter in software draws on the cores that the executors work on. With `WGPU_BACKEND=noop WGPU_NOOP_BACKEND=1` in
//! the environment there is a device that takes no time of them, as if it were a graphics card, and draws nothing.

use std::alloc::System;
use std::cell::Cell;
use std::error::Error;
use std::ops::RangeInclusive;
use std::time::Instant;

use clap::builder::RangedU64ValueParser;
use clap::{Parser, value_parser};
use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Look, Quality};
use dualframe_render_wgpu::picture::Picture;
use dualframe_render_wgpu::renderer::{OFFSCREEN_FORMAT, Offscreen, Painter};
use dualframe_sim::executor::{ExecutorKind, MAX_THREADS};
use dualframe_sim::experiment::calibrator::Calibrator;
use dualframe_sim::experiment::machine::Machine;
use dualframe_sim::experiment::race::{Runner, WARM_UP};
use dualframe_sim::experiment::statistics::Quartiles;
use dualframe_sim::experiment::timing::{Contender, Series, until_good};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::object::Object;
use dualframe_sim::render::{NullRenderer, Renderer};
use dualframe_sim::scene::ParticleScene;
use dualframe_sim::stages;
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};
use wgpu::{PollType, TextureUsages};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Pictures' width and height, in pixels: small, so that an adapter in software leaves time to measure.
const SIZE: (u32, u32) = (320, 180);

/// Frames that are not drawn, ahead of all that are; usually 500. Particles start close together, and drawing is a few
/// hundredths of what they take while they come apart; then it is some 12 to 20.
const AHEAD: u64 = 500;

/// Substeps that particles can make.
const SUBSTEPS: RangeInclusive<i64> = 1..=ParticleScene::MAX_SUBSTEPS as i64;

/// What is measured.
#[derive(Parser)]
struct Arguments {
    /// Good rounds in which the executors take turns; where the machine is disturbed, up to four times as many rounds
    /// are run.
    #[arg(long, value_name = "N", default_value_t = 15, value_parser = at_least_one(u64::MAX))]
    rounds: usize,
    /// Numbers of particles.
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_values_t = [100, 300, 1_000])]
    objects: Vec<usize>,
    /// Threads of the parallel executors.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = at_least_one(MAX_THREADS as u64))]
    threads: usize,
    /// The most substeps of a particle: with fewer, drawing is a larger part of the work.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = value_parser!(u32).range(SUBSTEPS))]
    most_substeps: u32,
    /// See only whether it runs.
    #[arg(long)]
    test: bool,
    /// What cargo adds.
    #[arg(long, hide = true)]
    bench: bool,
}

impl Arguments {
    fn scene(&self, objects: usize) -> ParticleScene {
        ParticleScene { most_substeps: self.most_substeps, ..ParticleScene::new(objects) }
    }

    /// Frames ahead of those that are drawn.
    fn ahead(&self) -> u64 {
        if self.test { 0 } else { AHEAD }
    }
}

fn at_least_one(most: u64) -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=most)
}

/// How a drawn run ended: the objects' state, and the last frame's picture.
#[derive(Clone, PartialEq)]
struct End {
    state: u64,
    picture: Picture,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = Arguments::parse();
    if arguments.test {
        arguments.objects = vec![20];
    }
    let adapter = Gpu::new(None)?.title();
    println!("{}; {adapter}, {} by {} pixels", Machine::this(), SIZE.0, SIZE.1);
    for &objects in &arguments.objects {
        token_time(&arguments, objects)?;
        executors(&arguments, objects)?;
    }
    Ok(())
}

/// Milliseconds of a frame under the token, beside those of a serial frame without drawing.
fn token_time(arguments: &Arguments, objects: usize) -> Result<(), Box<dyn Error>> {
    let (gpu, frames) = (Gpu::new(None)?, 40);
    let scene = arguments.scene(objects);
    let look = Look::room(scene.room());
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: SIZE.0, height: SIZE.1, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: OFFSCREEN_FORMAT,
        usage: TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    let picture = texture.create_view(&Default::default());
    let mut painter = Painter::new(gpu, look, Quality::Fast, OFFSCREEN_FORMAT, SIZE)?;
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() };
    let mut manager = VeManager::new(scene.build()?, settings)?;
    manager.run(arguments.ahead(), &mut NullRenderer::new(), &mut |_| ())?;
    let (mut adding, mut painting, mut working) = (Vec::new(), Vec::new(), Vec::new());
    let mut allocations = 0;
    for frame in 0..frames {
        let began = Instant::now();
        manager.run(1, &mut NullRenderer::new(), &mut |_| ())?;
        working.push(began.elapsed().as_secs_f64() * 1e3);
        let (began, mut before) = (Instant::now(), None);
        let mut add = Add(&mut painter);
        manager.visit(&mut |object| {
            stages::draw(object, &mut add);
            // With the first object the device's library takes memory for the frame.
            before.get_or_insert_with(|| ALLOCATOR.stats().allocations);
        });
        adding.push(began.elapsed().as_secs_f64() * 1e3);
        if frame > frames / 2 {
            allocations += ALLOCATOR.stats().allocations - before.unwrap_or(0);
        }
        let began = Instant::now();
        let mut encoder = painter.gpu().device.create_command_encoder(&Default::default());
        painter.paint(&mut encoder, &picture);
        painter.gpu().queue.submit([encoder.finish()]);
        painting.push(began.elapsed().as_secs_f64() * 1e3);
        painter.gpu().device.poll(PollType::wait_indefinitely())?;
    }
    let [adding, painting, working] = [adding, painting, working]
        .map(|times| Quartiles::of(times).map_or(f64::NAN, |all| all.median));
    let token = adding + painting;
    println!(
        "{objects} objects: under the token {token:.3} ms a frame (taking them {adding:.3}, encoding and \
         submitting {painting:.3}), {:.1} % of the frame's work; {allocations} allocations of ours",
        100.0 * token / (token + working)
    );
    Ok(())
}

/// Takes objects and ends no frame.
struct Add<'a>(&'a mut Painter);

impl Renderer for Add<'_> {
    fn draw(&mut self, object: &Object) {
        self.0.add(object);
    }

    fn swap(&mut self, _: u64) {}
}

/// Frames per second of each executor with every frame drawn.
fn executors(arguments: &Arguments, objects: usize) -> Result<(), Box<dyn Error>> {
    let &Arguments { rounds, threads, test, .. } = arguments;
    let (scene, ahead) = (arguments.scene(objects), arguments.ahead());
    let frames = if test { 3 } else { (60_000 / objects.max(1)).max(20) as u64 };
    let runners: Vec<Runner> = Runner::parallel(threads).chain([Runner::SERIAL]).collect();
    let expected = Cell::new(None);
    let contender = |&runner: &Runner| {
        let expected = &expected;
        let run = Box::new(move || drawn(runner, scene, [ahead, frames], expected));
        Contender { label: runner.label(), spins: true, run }
    };
    let mut contenders: Vec<Contender<'_, Box<dyn Error>>> =
        runners.iter().map(contender).collect();
    let calibrator = Calibrator::default();
    let phase = &mut || calibrator.phase();
    let rounds = if test { 1..=1 } else { until_good(rounds, &Machine::this()) };
    let series = Series::measure(&mut contenders, rounds, phase, &mut || ())?;
    let (marked, rounds, which) = (series.marked(), series.rounds().len(), series.best_rounds());
    println!("{objects} objects, every frame drawn, {marked} of {rounds} rounds marked:");
    println!("{:>24}   frames/s   pipeline over it", "");
    for (index, label) in series.labels().iter().enumerate() {
        let seconds = series.seconds(which, index).map_or(f64::NAN, |seconds| seconds.median);
        let over = series.ratio(which, index, 0).map_or(f64::NAN, |ratio| ratio.median);
        println!("{label:>24} {:10.1} {over:18.3}", frames as f64 / seconds);
    }
    Ok(())
}

/// Seconds of so many frames, all drawn, after so many others. They must end as another executor's do.
fn drawn(
    runner: Runner,
    scene: ParticleScene,
    [ahead, frames]: [u64; 2],
    expected: &Cell<Option<End>>,
) -> Result<f64, Box<dyn Error>> {
    let Runner { executor, threads } = runner;
    let settings = Settings { executor, threads, ..Settings::default() };
    let mut manager = VeManager::new(scene.build()?, settings)?;
    let look = Look::room(scene.room());
    let mut offscreen = Offscreen::new(Gpu::new(None)?, look, Quality::Fast, SIZE)?;
    manager.run(ahead, &mut NullRenderer::new(), &mut |_| ())?;
    manager.run(WARM_UP, &mut offscreen, &mut |_| ())?;
    let began = Instant::now();
    manager.run(frames, &mut offscreen, &mut |_| ())?;
    let seconds = began.elapsed().as_secs_f64();
    if !manager.quarantined().is_empty() {
        return Err(format!("objects were quarantined in {}", runner.label()).into());
    }
    let end = End { state: manager.state_hash(), picture: offscreen.picture()? };
    match expected.take() {
        Some(other) if other != end => {
            Err(format!("{} ended in another state or picture", runner.label()).into())
        }
        _ => {
            expected.set(Some(end));
            Ok(seconds)
        }
    }
}
